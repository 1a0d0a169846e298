"""``islands admin``: operation of a service, in its database: keys, owners, jobs, audit trail, backups."""

import json
from contextlib import closing
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import errors, output
from islands.errors import SettingsError
from islands_api.cli.service.admin_job_commands import jobs
from islands_api.cli.service.key_commands import keys
from islands_api.cli.service.owner_commands import owners
from islands_api.cli.service.store_options import Database, DataDir, open_store
from islands_service.settings import service_settings
from islands_service.store.cached_blobs import open_blobs
from islands_service.store.database import Database as StoreDatabase
from islands_service.supervisor import folder_lock

admin = typer.Typer(no_args_is_help=True, add_completion=False)
admin.command()(keys)
admin.command()(owners)
admin.command()(jobs)


@admin.command()
def audit(
    owner: Annotated[str | None, typer.Option("--owner", help="Only changes of this owner's data.")] = None,
    since: Annotated[
        datetime | None, typer.Option("--since", help="Only changes since this date or time, in UTC.")
    ] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="Number of changes, the newest first.")] = 100,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one change in each line.")] = False,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """List accepted changes: uploads, jobs, deletions and keys, with key and address of the client."""
    moment = None if since is None else since.replace(tzinfo=UTC).timestamp()
    with open_store(data_dir, database) as store:
        entries = store.audit.entries(owner, moment, limit)
    if as_json:
        for entry in entries:
            print(json.dumps({**asdict(entry), "at": _format_time(entry.at)}))
        return
    # Few entries have details, and the table has to fit into 80 columns.
    detailed = any(entry.details for entry in entries)
    names = ("action", "owner", "id", "key", "address", *(("details",) if detailed else ()))
    table = Table(Column("time", no_wrap=True), *(Column(name, overflow="fold") for name in names))
    for entry in entries:
        texts = [entry.action, entry.owner, entry.subject, entry.key_id, entry.address, entry.details]
        table.add_row(_format_time(entry.at), *(Text(text or "") for text in texts[: len(names)]))
    output.print(table, markup=False)


@admin.command()
def backup(
    folder: Annotated[Path, typer.Argument(help="Folder of the backup.")],
    verify: Annotated[bool, typer.Option("--verify", help="Read a whole backup and check it.")] = False,
    restore: Annotated[
        bool, typer.Option("--restore", help="Restore it into a new data folder and an empty database.")
    ] = False,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """Write a backup of database and files into a new folder, check one, or restore one.

    The service may run while a backup is written; start it after a restore.
    """
    from islands_service.backup import create_backup, restore_backup, verify_backup  # noqa: PLC0415

    settings = service_settings(data_dir=data_dir, database=database)
    if verify and restore:
        raise SettingsError("--verify and --restore are two steps: give one of them")
    if verify:
        done, manifest = "complete", verify_backup(folder, _report)
    elif restore:
        with folder_lock(settings.data_dir), closing(StoreDatabase(settings.url)) as opened:
            done, manifest = "restored", restore_backup(folder, opened, open_blobs(settings), _report)
    else:
        with open_store(data_dir, database) as store:
            done, manifest = "written", create_backup(store.database, open_blobs(settings), folder, _report)
    rows = {name: about["rows"] for name, about in manifest["tables"].items()}
    output.print(
        f"{folder} is {done}: {rows['jobs']} jobs, {rows['datasets']} data sets, {manifest['blobs']} files, "
        f"of islands {manifest['islands']}",
        markup=False,
    )


def _report(line: str) -> None:
    errors.print(line, markup=False)


def _format_time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
