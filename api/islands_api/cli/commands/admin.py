"""``islands admin``: operation of a service, in its database: audit trail, owners, jobs, backups."""

import json
from contextlib import closing
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import errors, output
from islands_api.cli.service.admin_job_commands import jobs
from islands_api.cli.service.owner_commands import owners
from islands_api.cli.service.store_options import Database, DataDir, open_store
from islands_service.settings import service_settings
from islands_service.store.cached_blobs import open_blobs
from islands_service.store.database import Database as StoreDatabase
from islands_service.supervisor import folder_lock

admin = typer.Typer(
    help="Operation of a service: audit, owners, jobs, backup, restore.",
    no_args_is_help=True,
    add_completion=False,
)
admin.command()(owners)
admin.command()(jobs)

Folder = Annotated[Path, typer.Argument(help="Folder of the backup.")]


@admin.callback()
def _admin() -> None:
    """Operation of a service: audit, owners, jobs, backup, restore."""


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
    folder: Folder,
    verify: Annotated[bool, typer.Option("--verify", help="Read a whole backup and check it.")] = False,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """Write a backup of database and files into a new folder. The service may run meanwhile."""
    from islands_service.backup import create_backup, verify_backup  # noqa: PLC0415

    if verify:
        _print_manifest("complete", folder, verify_backup(folder, _report))
        return
    settings = service_settings(data_dir=data_dir, database=database)
    with open_store(data_dir, database) as store:
        manifest = create_backup(store.database, open_blobs(settings), folder, _report)
    _print_manifest("written", folder, manifest)


@admin.command()
def restore(folder: Folder, data_dir: DataDir = None, database: Database = None) -> None:
    """Restore a backup into a new data folder and an empty database. Start the service afterwards."""
    from islands_service.backup import restore_backup  # noqa: PLC0415

    settings = service_settings(data_dir=data_dir, database=database)
    with folder_lock(settings.data_dir), closing(StoreDatabase(settings.url)) as opened:
        manifest = restore_backup(folder, opened, open_blobs(settings), _report)
    _print_manifest("restored", folder, manifest)


def _report(line: str) -> None:
    errors.print(line, markup=False)


def _print_manifest(done: str, folder: Path, manifest: dict[str, Any]) -> None:
    rows = {name: about["rows"] for name, about in manifest["tables"].items()}
    output.print(
        f"{folder} is {done}: {rows['jobs']} jobs, {rows['datasets']} data sets, {manifest['blobs']} files, "
        f"of islands {manifest['islands']}",
        markup=False,
    )


def _format_time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
