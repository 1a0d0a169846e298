"""Migrations create the tables of the code; a database that they do not know is refused."""

from contextlib import ExitStack

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import inspect, text

from islands_service.store import Store
from islands_service.store.database import Database, StoreError
from islands_service.store.migrations.upgrade import HEAD, configuration, prepare, revision, upgrade
from islands_service.store.tables import metadata
from support.stores import child, contents, submitted

pytestmark = pytest.mark.ci

PREPARE = """
import sys
import alembic.command
from islands_service.store import Store
print("ready", flush=True)
for url in sys.argv[1:]:
    sys.stdin.readline()
    Store(url).close()
    print("prepared", flush=True)
"""

MODULES = """
import sys
from islands_service.store import Store
with Store(sys.argv[1]) as store:
    store.jobs.page("alice")
print(*(name for name in sys.modules if name.partition(".")[0] in ("alembic", "mako")))
"""


def test_the_code_is_written_for_the_last_revision():
    script = ScriptDirectory.from_config(configuration())
    assert script.get_heads() == [HEAD]


def test_migrations_create_the_tables_of_the_code(empty_database):
    with Store(empty_database) as store, store.database.read() as connection:
        assert compare_metadata(MigrationContext.configure(connection), metadata) == []
        found = inspect(connection)
        for table in metadata.sorted_tables:
            key = found.get_pk_constraint(table.name)
            assert (key["name"], key["constrained_columns"]) == (
                f"pk_{table.name}",
                [column.name for column in table.primary_key],
            )
            for foreign in found.get_foreign_keys(table.name):
                assert foreign["options"] == {"ondelete": "CASCADE"}


def test_concurrent_preparation_of_new_databases_succeeds(empty_database, tmp_path):
    urls = [empty_database]
    if empty_database.startswith("sqlite"):
        urls += [f"sqlite:///{tmp_path / f'{number}.db'}" for number in range(4)]
    with ExitStack() as stack:
        processes = [stack.enter_context(child(PREPARE, *urls)) for _ in range(2)]
        for process in processes:
            assert process.stdout.readline() == "ready\n"
        for _ in urls:
            for process in processes:
                process.stdin.write("\n")
                process.stdin.flush()
            assert [process.stdout.readline() for process in processes] == ["prepared\n"] * 2
    for url in urls:
        with Store(url) as store:
            submitted(store)


def test_current_database_does_not_import_alembic(database):
    """Importing Alembic takes a quarter of a second."""
    with child(MODULES, database) as process:
        said, _ = process.communicate(timeout=60)
    assert said == "\n"


@pytest.mark.parametrize("other", ["0012", "9.0.0"])
def test_database_of_an_unknown_version_is_refused_unchanged(empty_database, other):
    with Store(empty_database) as store:
        submitted(store)
        before = contents(store)
        change = text("UPDATE alembic_version SET version_num = :other").bindparams(other=other)
        store.database.write(lambda connection: connection.execute(change))
        with pytest.raises(StoreError, match=rf"the revision {other} .* or begin with an empty database"):
            Store(empty_database)
        assert contents(store) == before
        with store.database.read() as connection:
            assert revision(connection) == other


def test_interrupted_migration_is_rolled_back(empty_database):
    made = Database(empty_database)

    def interrupted():
        with made.exclusive() as connection:
            upgrade(connection)
            assert revision(connection) == HEAD
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    with made.read() as connection:
        assert inspect(connection).get_table_names() == []
    prepare(made)
    with made.read() as connection:
        assert revision(connection) == HEAD
    made.close()
