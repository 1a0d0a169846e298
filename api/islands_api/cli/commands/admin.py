"""``islands admin``: operation of a service, in its database."""

import json
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Annotated

import typer
from rich.table import Column, Table

from islands_api.cli.console import output
from islands_api.cli.service.store_options import Database, DataDir, open_store

admin = typer.Typer(help="Operation of a service: audit.", no_args_is_help=True, add_completion=False)


@admin.callback()
def _admin() -> None:
    """Operation of a service: audit."""


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
    table = Table(
        Column("time", no_wrap=True),
        *(Column(name, overflow="fold") for name in ("action", "owner", "id", "key", "address")),
    )
    for entry in entries:
        texts = (entry.action, entry.owner, entry.subject, entry.key_id or "", entry.address)
        table.add_row(_format_time(entry.at), *texts)
    output.print(table, markup=False)


def _format_time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
