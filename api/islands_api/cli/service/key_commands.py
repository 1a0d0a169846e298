"""``islands admin keys``: the API keys of a service, in its database."""

from math import inf
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import errors, output
from islands.errors import SettingsError
from islands_api.cli.service.store_options import COMMAND_LINE, Database, DataDir, open_store
from islands_service.store.keys import SCOPES

#: Seconds of a day.
_DAY_SECONDS = 86_400.0


def keys(
    scopes: Annotated[
        list[str] | None,
        typer.Option("--scope", help=f"Create a key with this scope; repeat it: {', '.join(SCOPES)}."),
    ] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the new key, for display.")] = "",
    owner: Annotated[
        str | None,
        typer.Option("--owner", help="Share this owner's data sets and jobs; a new owner by default."),
    ] = None,
    days: Annotated[
        float | None, typer.Option("--days", help="Days until the new key expires; never by default.")
    ] = None,
    revoke: Annotated[
        str | None,
        typer.Option("--revoke", metavar="KEY", help="Revoke this key; the service rejects it in a second."),
    ] = None,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """List the API keys of a service, create one, or revoke one.

    A new key is printed once: only its hash is stored.
    """
    if days is not None and not 0.0 < days < inf:
        raise SettingsError(f"--days is a number of days above 0, got {days:g}")
    if scopes and revoke is not None:
        raise SettingsError("--scope creates a key, and --revoke revokes one: give one of them")
    if not scopes and (name or owner is not None or days is not None):
        raise SettingsError("a new key needs a scope: give --scope read, for example")
    if revoke is not None:
        with open_store(data_dir, database) as store:
            store.keys.revoke(revoke, COMMAND_LINE)
        output.print(f"key {revoke} is revoked", markup=False)
    elif scopes:
        lifetime = None if days is None else days * _DAY_SECONDS
        with open_store(data_dir, database) as store:
            key, secret = store.keys.create(name, frozenset(scopes), owner, lifetime, COMMAND_LINE)
        output.print(secret, markup=False)
        # Standard output can be the file that a program reads the key from.
        errors.print(f"key {key.id} of owner {key.owner}: {', '.join(sorted(key.scopes))}", markup=False)
    else:
        _list(data_dir, database)


def _list(data_dir: Path | None, database: str | None) -> None:
    # Ids are never truncated; other columns wrap in a narrow terminal.
    table = Table(
        Column("key", no_wrap=True),
        *(Column(name, overflow="fold") for name in ("name", "owner", "scopes")),
        Column("state", no_wrap=True),
    )
    with open_store(data_dir, database) as store:
        for key in store.keys.all():
            state = "revoked" if key.revoked is not None else "expired" if key.expired else "valid"
            # Names may contain characters that Rich takes for markup.
            table.add_row(key.id, Text(key.name), Text(key.owner), ", ".join(sorted(key.scopes)), state)
    output.print(table)
