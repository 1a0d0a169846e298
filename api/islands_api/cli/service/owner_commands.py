"""``islands admin owners``: weights and quotas of owners, in the database of a service."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import output
from islands_api.cli.service.store_options import COMMAND_LINE, Database, DataDir, open_store
from islands_service.domain.owner import DEFAULT_WEIGHT, QUOTA_NAMES, Owner

owners = typer.Typer(
    help="Owners of jobs and data sets: weights and quotas.", no_args_is_help=True, add_completion=False
)


@owners.command("list")
def list_owners(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one owner in each line.")] = False,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """List the owners of all keys, jobs and data sets with their weights, quotas and use of the service."""
    with open_store(data_dir, database) as store:
        found = store.owners.all()
    if as_json:
        for owner in found:
            print(json.dumps(asdict(owner)))
        return
    table = Table(
        Column("owner", overflow="fold"),
        *(Column(name, justify="right") for name in ("weight", "queued", "running", "islands", "stored MB")),
        Column("quotas", overflow="fold"),
    )
    for owner in found:
        stored = f"{owner.stored / 1e6:.1f}"
        # Names may contain characters that Rich takes for markup.
        numbers = map(str, (owner.weight, owner.queued, owner.running, owner.running_islands))
        table.add_row(Text(owner.name), *numbers, stored, _describe_quotas(owner))
    output.print(table)


@owners.command("set")
def set_owner(
    owner: Annotated[str, typer.Argument(help="Name of the owner, from the list.")],
    weight: Annotated[
        int | None, typer.Option("--weight", help=f"Share of the claims; {DEFAULT_WEIGHT} by default.")
    ] = None,
    max_active: Annotated[int | None, typer.Option("--max-active", help="Queued and running jobs.")] = None,
    max_running: Annotated[
        int | None, typer.Option("--max-running", help="Running jobs; further ones stay in the queue.")
    ] = None,
    max_islands: Annotated[
        int | None,
        typer.Option("--max-islands", help="Islands of the running jobs; further jobs stay in the queue."),
    ] = None,
    max_run_seconds: Annotated[
        int | None,
        typer.Option("--max-run-seconds", help="Run time of each job; also of the present jobs."),
    ] = None,
    max_uploads: Annotated[
        int | None, typer.Option("--max-uploads", help="Uploads in progress, of each API process.")
    ] = None,
    max_stored: Annotated[int | None, typer.Option("--max-stored", help="Bytes of data sets.")] = None,
    max_streams: Annotated[
        int | None, typer.Option("--max-streams", help="Open event streams, of each API process.")
    ] = None,
    max_drawings: Annotated[
        int | None,
        typer.Option("--max-drawings", help="Requests whose figures are being drawn, of each API process."),
    ] = None,
    dataset_retention: Annotated[
        int | None,
        typer.Option("--dataset-retention", help="Seconds that a data set without jobs is kept; 0 for ever."),
    ] = None,
    unset: Annotated[
        list[str] | None,
        typer.Option("--unset", help="Restore a default: weight, or a quota such as max-active. Repeat it."),
    ] = None,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """Change the weight and the quotas of an owner. They apply at once."""
    given = {
        "weight": weight,
        "max_active": max_active,
        "max_running": max_running,
        "max_islands": max_islands,
        "max_run_seconds": max_run_seconds,
        "max_uploads": max_uploads,
        "max_stored": max_stored,
        "max_streams": max_streams,
        "max_drawings": max_drawings,
        "dataset_retention": dataset_retention,
    }
    changes = {name: value for name, value in given.items() if value is not None}
    restored: dict[str, int | None] = {name.replace("-", "_"): None for name in unset or ()}
    with open_store(data_dir, database) as store:
        changed = store.owners.change(owner, {**restored, **changes}, COMMAND_LINE)
    output.print(f"owner {owner}: weight {changed.weight}, {_describe_quotas(changed)}", markup=False)


def _describe_quotas(owner: Owner) -> str:
    own = {name: owner.quotas[name] for name in QUOTA_NAMES if owner.quotas[name] is not None}
    return ", ".join(f"{name} {most}" for name, most in own.items()) or "default quotas"
