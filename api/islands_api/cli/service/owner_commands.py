"""``islands admin owners``: weights and quotas of owners, in the database of a service."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import output
from islands.cli.settings_options import split_settings
from islands.errors import SettingsError
from islands_api.cli.service.store_options import COMMAND_LINE, Database, DataDir, open_store
from islands_service.domain.owner import DEFAULT_WEIGHT, QUOTA_NAMES, Owner


def owners(
    owner: Annotated[str | None, typer.Argument(help="Owner to change; without one, all are listed.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=NUMBER",
            help=f"weight, the share of the claims ({DEFAULT_WEIGHT} by default), or a quota: "
            f"{', '.join(QUOTA_NAMES)}.",
        ),
    ] = None,
    unset: Annotated[
        list[str] | None,
        typer.Option("--unset", help="Restore a default: weight, or a quota such as max_active. Repeat it."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one owner in each line.")] = False,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """List owners with weights, quotas and use of the service, or change one. Changes apply at once."""
    if owner is None:
        _list(data_dir, database, as_json)
        return
    given: dict[str, int | None] = {name.replace("-", "_"): None for name in unset or ()}
    for name, text in split_settings(changes or []).items():
        try:
            given[name] = int(text)
        except ValueError:
            raise SettingsError(f"{name} is an integer, got {text!r}") from None
    with open_store(data_dir, database) as store:
        changed = store.owners.change(owner, given, COMMAND_LINE)
    output.print(f"owner {owner}: weight {changed.weight}, {_describe_quotas(changed)}", markup=False)


def _list(data_dir: Path | None, database: str | None, as_json: bool) -> None:
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


def _describe_quotas(owner: Owner) -> str:
    own = {name: owner.quotas[name] for name in QUOTA_NAMES if owner.quotas[name] is not None}
    return ", ".join(f"{name} {most}" for name, most in own.items()) or "default quotas"
