"""Schema of the database: created if it is new, migrated if it is older than the code."""

from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text

from islands_service.domain.job import ISLANDS_VERSION
from islands_service.store import dialect
from islands_service.store.database import Database, StoreError

if TYPE_CHECKING:
    from alembic.config import Config

#: Revision that the code is written for. Importing Alembic takes a quarter of a second, and a database of
#: this revision does not need it. A test compares this constant with the migrations.
HEAD = "0.2.0"


def prepare(database: Database) -> None:
    """Bring a database to the revision of the code.

    Several processes may call this concurrently: one migrates, the others wait.

    Raises
    ------
    StoreError
        Another version of islands made the database, and this one cannot migrate it.
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


def upgrade(connection: Connection, to: str = HEAD) -> None:
    """Migrate the schema within the transaction of the connection.

    Raises
    ------
    StoreError
        This version of islands does not know the revision of the database, or the one to migrate to.
    """
    from alembic import command  # noqa: PLC0415
    from alembic.script import ScriptDirectory  # noqa: PLC0415

    config = configuration()
    config.attributes["connection"] = connection
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    for number in filter(None, (revision(connection), to)):
        if number not in known:
            raise StoreError(
                f"islands {ISLANDS_VERSION} does not know the revision {number} of the database: a newer "
                "version made it, or one from before the first release. Run that version, or begin with an "
                "empty database (another --data-dir or --database)"
            )
    command.upgrade(config, to)


def configuration() -> "Config":
    """Return the Alembic configuration of the migrations."""
    from alembic.config import Config  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", "islands_service:store/migrations")
    config.set_main_option("path_separator", "os")
    return config
