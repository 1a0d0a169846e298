"""``islands keys``: create, list and revoke the API keys of a service, in its database."""

from math import inf
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import errors, output
from islands.errors import SettingsError
from islands_api.cli.service.store_options import COMMAND_LINE, Database, DataDir, open_store
from islands_service.store.keys import SCOPES

keys = typer.Typer(
    help="API keys of a service: create, list, revoke.", no_args_is_help=True, add_completion=False
)

#: Seconds of a day.
_DAY_SECONDS = 86_400.0


@keys.command()
def create(
    scopes: Annotated[list[str], typer.Option("--scope", help=f"Repeat it: {', '.join(SCOPES)}.")],
    name: Annotated[str, typer.Option("--name", help="Name of the key, for display.")] = "",
    owner: Annotated[
        str | None,
        typer.Option("--owner", help="Share this owner's data sets and jobs; a new owner by default."),
    ] = None,
    days: Annotated[
        float | None, typer.Option("--days", help="Days until the key expires; never by default.")
    ] = None,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """Create a key and print it. It is shown once: only its hash is stored."""
    if days is not None and not 0.0 < days < inf:
        raise SettingsError(f"--days is a number of days above 0, got {days:g}")
    with open_store(data_dir, database) as store:
        key, secret = store.keys.create(
            name, frozenset(scopes), owner, None if days is None else days * _DAY_SECONDS, COMMAND_LINE
        )
    output.print(secret, markup=False)
    # Standard output can be the file that a program reads the key from.
    errors.print(f"key {key.id} of owner {key.owner}: {', '.join(sorted(key.scopes))}", markup=False)


@keys.command("list")
def list_keys(data_dir: DataDir = None, database: Database = None) -> None:
    """List the keys, without their secrets."""
    with open_store(data_dir, database) as store:
        # Ids are never truncated; other columns wrap in a narrow terminal.
        table = Table(
            Column("key", no_wrap=True),
            *(Column(name, overflow="fold") for name in ("name", "owner", "scopes")),
            Column("state", no_wrap=True),
        )
        for key in store.keys.all():
            state = "revoked" if key.revoked is not None else "expired" if key.expired else "valid"
            # Names may contain characters that Rich takes for markup.
            table.add_row(key.id, Text(key.name), Text(key.owner), ", ".join(sorted(key.scopes)), state)
    output.print(table)


@keys.command()
def revoke(
    key: Annotated[str, typer.Argument(help="The key's id, from the list.")],
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """Revoke a key. The service rejects it within a second."""
    with open_store(data_dir, database) as store:
        store.keys.revoke(key, COMMAND_LINE)
    output.print(f"key {key} is revoked", markup=False)
