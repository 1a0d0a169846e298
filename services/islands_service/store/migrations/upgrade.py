"""Schema of the database: created if it is new, migrated if it is older than the code."""

from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text

from islands_service.store.backends import dialect
from islands_service.store.database import Database, StoreError

if TYPE_CHECKING:
    from alembic.config import Config

#: Revision that the code is written for. Importing Alembic takes a quarter of a second, and a database of
#: this revision does not need it. A test compares this constant with the migrations.
HEAD = "0012"


def prepare(database: Database) -> None:
    """Bring a database to the revision of the code.

    Several processes may call this concurrently: one migrates, the others wait.

    Raises
    ------
    StoreError
        The database was written by a newer version of islands.
    """
    with database.read() as connection:
        if revision(connection) == HEAD:
            return
    with database.exclusive() as connection:
        dialect.lock_migration(connection)
        upgrade(connection)


def revision(connection: Connection) -> str | None:
    """Return the revision of a database; None if it is new."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    found: str | None = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return found


def upgrade(connection: Connection, to: str = "head") -> None:
    """Migrate the schema within the transaction of the connection.

    Raises
    ------
    StoreError
        The database was written by a newer version of islands.
    """
    from alembic import command  # noqa: PLC0415
    from alembic.script import ScriptDirectory  # noqa: PLC0415

    config = configuration()
    config.attributes["connection"] = connection
    current = revision(connection)
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if current is not None and current not in known:
        raise StoreError(
            f"the database has revision {current}, which this version of islands does not know: it was made "
            "by a newer one; run that, or give another database"
        )
    command.upgrade(config, to)


def configuration() -> "Config":
    """Return the Alembic configuration of the migrations."""
    from alembic.config import Config  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", "islands_service:store/migrations")
    config.set_main_option("path_separator", "os")
    return config
