"""Options of commands that open the database of a service."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from islands.errors import SettingsError
from islands_service.domain.job import Requester
from islands_service.settings import service_settings
from islands_service.supervisor import make_private

if TYPE_CHECKING:
    from islands_service.store import Store

#: Origin of changes by these commands, in the audit trail.
COMMAND_LINE = Requester("command line")


def refuse_password(value: str) -> None:
    """Refuse a password on the command line, which every user of the machine can read.

    Raises
    ------
    SettingsError
    """
    # `islands serve` starts faster without this import.
    from sqlalchemy import make_url  # noqa: PLC0415
    from sqlalchemy.exc import ArgumentError  # noqa: PLC0415

    try:
        url = make_url(value)
    except ArgumentError as error:
        raise SettingsError(
            "--database is not the URL of a database: write postgresql+psycopg://USER@HOST/NAME"
        ) from error
    if url.password is not None or "password" in url.query:
        raise SettingsError(
            "--database contains a password, and every user of this machine can read the arguments of a "
            "process: give the URL as ISLANDS_DATABASE, or in a file named by ISLANDS_DATABASE_FILE"
        )


def _check_database(context: typer.Context, parameter: typer.CallbackParam, value: str | None) -> str | None:
    source = context.get_parameter_source(str(parameter.name))
    if value and source is not None and source.name == "COMMANDLINE":
        refuse_password(value)
    return value


DataDir = Annotated[Path | None, typer.Option("--data-dir", help="The service's data folder.")]
Database = Annotated[
    str | None,
    typer.Option(
        "--database",
        callback=_check_database,
        help="The service's database, if it is not in the data folder; without a password.",
    ),
]


def open_store(data_dir: Path | None, database: str | None) -> "Store":
    """Open the store of a service."""
    from islands_service.store import Store  # noqa: PLC0415

    settings = service_settings(data_dir=data_dir, database=database)
    make_private(settings.data_dir)
    return Store(settings.url)
