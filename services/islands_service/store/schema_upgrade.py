"""The schema of a database: made when it is new, migrated when it is older than the code."""

from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text

from islands_service.store import dialect
from islands_service.store.database import Database, StoreError

if TYPE_CHECKING:
    from alembic.config import Config

#: The revision that the code is written for. Alembic takes a quarter of a second to import, and a database
#: that has this revision needs none of it. A test holds it against the migrations.
HEAD = "0001"


def prepare(database: Database) -> None:
    """Bring a database to the revision that the code is written for.

    Several processes may do this at once: one migrates, the others wait.

    Raises
    ------
    StoreError
        The database was made by a newer version of islands.
    """
    with database.read() as connection:
        if revision(connection) == HEAD:
            return
    with database.exclusive() as connection:
        dialect.lock_migration(connection)
        upgrade(connection)


def revision(connection: Connection) -> str | None:
    """Return a database's revision, None if it is new."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    found: str | None = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return found


def upgrade(connection: Connection, to: str = "head") -> None:
    """Migrate in the connection's transaction.

    Raises
    ------
    StoreError
        The database was made by a newer version of islands.
    """
    from alembic import command  # noqa: PLC0415
    from alembic.script import ScriptDirectory  # noqa: PLC0415

    config = configuration()
    config.attributes["connection"] = connection
    there = revision(connection)
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if there is not None and there not in known:
        raise StoreError(
            f"the database has revision {there}, which this version of islands does not know: it was made by "
            "a newer one; run that, or give another database"
        )
    command.upgrade(config, to)


def configuration() -> "Config":
    """Return where Alembic finds the migrations."""
    from alembic.config import Config  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", "islands_service:store/migrations")
    config.set_main_option("path_separator", "os")
    return config
