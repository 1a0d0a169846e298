"""Migrations: a database of any revision is upgraded to the current tables with its rows."""

import json
import sqlite3
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import MetaData, create_engine, inspect, select, text

from islands_service.domain.job import JobState
from islands_service.store import Store
from islands_service.store.database import Database, StoreError
from islands_service.store.migrations.upgrade import HEAD, configuration, prepare, revision, upgrade
from islands_service.store.monitor_states import STATE_SCHEMA
from islands_service.store.tables import metadata
from support.stores import ALICE, BOB, asked, child, contents, kinds, submitted

pytestmark = pytest.mark.ci

#: Written by `dump.py` when each revision was the last one.
DUMPS = Path(__file__).parent

REVISIONS = sorted(path.stem for path in DUMPS.glob("*.sql"))

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


def restored(number, path):
    """Create the database of a dump."""
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript((DUMPS / f"{number}.sql").read_text())


def tables_of(connection):
    found = MetaData()
    found.reflect(connection)
    return {table.name: table for table in found.sorted_tables if table.name != "alembic_version"}


def rows(connection, columns=None):
    """Return the rows of all tables by name, reduced to some columns if given."""
    found = {}
    for name, table in tables_of(connection).items():
        if columns is not None and name not in columns:
            continue
        names = sorted(set(table.c.keys()) & set(columns[name]) if columns else table.c.keys())
        taken = connection.execute(select(*(table.c[each] for each in names))).mappings()
        found[name] = sorted((dict(row) for row in taken), key=repr)
    return found


@pytest.fixture(params=REVISIONS)
def old(request, empty_database, tmp_path):
    """A database of an earlier revision with rows in all tables: its URL, and the rows."""
    source = tmp_path / "source.db"
    restored(request.param, source)
    reading = create_engine(f"sqlite:///{source}")
    with reading.connect() as there:
        kept = rows(there)
    reading.dispose()
    if empty_database.startswith("sqlite"):
        return f"sqlite:///{source}", kept
    target = Database(empty_database)
    with target.exclusive() as here:
        upgrade(here, request.param)
        for name, table in tables_of(here).items():
            if kept[name]:
                here.execute(table.insert(), kept[name])
    target.close()
    return empty_database, kept


def test_the_code_is_written_for_the_last_revision():
    script = ScriptDirectory.from_config(configuration())
    assert script.get_heads() == [HEAD]
    # The revisions are a single line of consecutive numbers.
    numbers = [each.revision for each in script.walk_revisions()][::-1]
    assert numbers == [f"{number:04d}" for number in range(1, len(numbers) + 1)]


def test_every_revision_has_a_dump():
    script = ScriptDirectory.from_config(configuration())
    missing = {each.revision for each in script.walk_revisions()} - set(REVISIONS)
    assert not missing, f"python {DUMPS / 'dump.py'}"


@pytest.mark.parametrize("number", REVISIONS)
def test_a_revision_never_changes(number, tmp_path):
    """Databases of the revision exist, and have the schema of its dump."""

    def shape(path):
        with closing(sqlite3.connect(path)) as connection:
            query = "SELECT type, name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite_%' ORDER BY 1, 2"
            return connection.execute(query).fetchall()

    restored(number, tmp_path / "then.db")
    database = Database(f"sqlite:///{tmp_path / 'now.db'}")
    with database.exclusive() as connection:
        upgrade(connection, number)
    database.close()
    assert shape(tmp_path / "now.db") == shape(tmp_path / "then.db")


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


def test_rows_of_an_old_database_are_kept(old):
    url, kept = old
    with Store(url) as store, store.database.read() as connection:
        assert revision(connection) == HEAD
        columns = {name: found[0].keys() if found else () for name, found in kept.items()}
        assert rows(connection, columns) == kept
        assert all(kept.values()), "a dump has something in every table"


def test_migrated_database_works_like_a_new_one(old):
    url, _ = old
    with Store(url) as store:
        mine = {job.state: job for job in store.jobs.page(ALICE).jobs}
        theirs = {job.state: job for job in store.jobs.page(BOB).jobs}
        assert set(mine) == {JobState.SUCCEEDED, JobState.CANCELLED, JobState.RUNNING}
        assert set(theirs) == {JobState.FAILED, JobState.QUEUED}
        for job in (*mine.values(), *theirs.values()):
            assert kinds(store, job.id)[0] == "queued"
        done = mine[JobState.SUCCEEDED]
        assert [model.file for model in store.results.models(done.id)] == ["first", "second"]
        assert store.results.history(done.id) == [[3, 30, {"3": 0.25}, [0.5, None]]]
        assert store.datasets.page(ALICE)[0][0].name == "Bühne.csv"
        assert store.keys.all()[0].revoked is not None
        assert theirs[JobState.QUEUED].spec == {"value": 0.1 + 0.2}
        # The lease of the running job has expired since the dump was written.
        claimed = {store.leases.claim(name, 60.0).job.id for name in ("today", "tomorrow")}
        assert claimed == {mine[JobState.RUNNING].id, theirs[JobState.QUEUED].id}
        store.jobs.resume(BOB, theirs[JobState.FAILED].id)
        store.jobs.delete(ALICE, done.id)
        failed = theirs[JobState.FAILED]
        again, new = store.jobs.submit(asked(BOB, spec=failed.spec, name=failed.name, idempotency_key="k"))
        assert (again.id, new) == (failed.id, False)


def test_islands_of_earlier_jobs_are_those_of_their_specification(empty_database):
    stated = {"a": {"islands": 8}, "b": {"islands": None}, "c": {"population": 9}, "d": None}
    database = Database(empty_database)
    with database.exclusive() as connection:
        upgrade(connection, "0006")
        table = tables_of(connection)["jobs"]
        for name, settings in stated.items():
            spec = json.dumps({"settings": settings} if settings else {"channels": ["islands"]})
            texts = {"owner": ALICE, "kind": "", "name": "", "request_sha256": "", "state": "queued"}
            numbers = ("priority", "version", "attempt", "stalled", "lease_epoch", "lease_until")
            values = {**texts, **dict.fromkeys(numbers, 0), "created": 0.0, "updated": 0.0}
            connection.execute(
                table.insert(), {**values, "id": name, "spec": spec, "cancel_requested": False}
            )
        upgrade(connection)
        table = tables_of(connection)["jobs"]
        found = connection.execute(select(table.c.id, table.c.islands)).all()
    database.close()
    assert dict(map(tuple, found)) == {"a": 8, "b": 1, "c": 1, "d": 1}


def test_jobs_of_an_earlier_release_are_found_by_a_search(empty_database):
    equation = "y(k) = 0.9 y(k-1) + tanh(u(k-1))"
    summary = {"equation": equation, "words": "As a simulation: good.", "metrics": {"mape": 1.5}}
    database = Database(empty_database)
    with database.exclusive() as connection:
        upgrade(connection, "0010")
        tables = tables_of(connection)
        texts = {"id": "e" * 32, "owner": ALICE, "kind": "", "name": "Stage Ä", "request_sha256": ""}
        numbers = dict.fromkeys(
            ("priority", "version", "attempt", "stalled", "lease_epoch", "lease_until"), 0
        )
        job = {"spec": json.dumps({"dataset": "d-csv"}), "state": "succeeded", "summary": json.dumps(summary)}
        times = {"created": 0.0, "updated": 0.0}
        connection.execute(
            tables["jobs"].insert(), {**texts, **numbers, **job, **times, "cancel_requested": False}
        )
        stored = {"owner": ALICE, "id": "d-csv", "name": "Piezo.csv", "suffix": ".csv", "blob": "b" * 64}
        connection.execute(
            tables["datasets"].insert(), {**stored, "bytes": 1, "preview": "{}", "created": 0.0}
        )
    database.close()
    with Store(empty_database) as store:
        for words in (["stage", "ä"], ["piezo.csv"], ["TANH("]):
            (found,) = store.jobs.page(ALICE, words=words).jobs
            assert (found.dataset_name, found.tags) == ("Piezo.csv", ())
        assert store.jobs.page(ALICE, words=["simulation"]).jobs == ()
        assert store.jobs.page(ALICE, by_error=True).jobs == (found,)


def test_records_of_a_monitor_are_moved_to_rows(empty_database):
    """The analysis continues with the same states, and clients find the same records."""
    record, rejected = {"name": "a", "sha256": "1", "noise": 0.1 + 0.2}, {"name": "b", "sha256": "2"}
    state = {"schema": STATE_SCHEMA, "state": {"records": [record] * 3, "start": 2}, "rejected": [rejected]}
    alarm = {"words": "k changed"}
    document = {"status": "alarm", "alarms": [alarm], "records": [record] * 3, "rejected": [rejected]}
    texts = {"id": "e" * 32, "owner": ALICE, "name": "press", "spec": "{}", "status": "alarm"}
    numbers = {"priority": 0, "version": 4, "submitted": 4, "records": 3, "alarms": 1}
    states = {"state": json.dumps(state) + "\n", "document": json.dumps(document)}
    database = Database(empty_database)
    with database.exclusive() as connection:
        upgrade(connection, "0008")
        values = {**texts, **numbers, **states, "created": 0.0, "updated": 0.0, "islands_version": "1"}
        connection.execute(tables_of(connection)["monitors"].insert(), values)
    database.close()
    with Store(empty_database) as store:
        monitor, loaded = store.monitors.load(ALICE, texts["id"])
        assert store.monitors.saved(ALICE, texts["id"]) == states["state"]
        assert (loaded.start, loaded.records) == (2, (json.dumps(record),))
        assert json.loads(loaded.document) == {"status": "alarm", "alarms": [alarm]}
        assert monitor.last_alarm == alarm
        for is_rejected, expected in ((False, [record] * 3), (True, [rejected])):
            found = map(json.loads, store.monitors.records(ALICE, texts["id"], is_rejected))
            assert list(found) == [{"index": at, **each} for at, each in enumerate(expected)]


def test_running_process_of_an_earlier_release_can_write_after_the_migration(old):
    """During a rolling upgrade it inserts rows without the new columns."""
    url, kept = old
    with Store(url) as store:
        (row,) = (each for each in kept["jobs"] if each["state"] == "queued")
        new = {**row, "id": "e" * 32, "idempotency_key": None, "priority": 100}
        (dataset,) = kept["datasets"]

        def insert(connection):
            connection.execute(metadata.tables["jobs"].insert(), new)
            connection.execute(metadata.tables["datasets"].insert(), {**dataset, "owner": BOB})

        store.database.write(insert)
        (running,) = (each for each in kept["jobs"] if each["state"] == "running")
        claimed = {store.leases.claim(name, 60.0).job.id for name in ("one", "other", "third")}
        assert claimed == {running["id"], row["id"], new["id"]}
        assert store.datasets.page(BOB)[0][0].preview["columns"] == 1


def test_new_database_is_empty(empty_database):
    with Store(empty_database) as store:
        assert not any(contents(store).values())
        submitted(store)


def test_repeated_preparation_changes_nothing(database):
    with Store(database) as store:
        submitted(store)
        before = contents(store)
        prepare(store.database)
        with store.database.exclusive() as connection:
            upgrade(connection)
        assert contents(store) == before


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


def test_database_of_a_newer_version_is_refused_unchanged(empty_database):
    with Store(empty_database) as store:
        submitted(store)
        before = contents(store)
        store.database.write(
            lambda connection: connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        )
        with pytest.raises(StoreError, match=r"has revision 9999, .* made by a newer one"):
            Store(empty_database)
        assert contents(store) == before
        with store.database.read() as connection:
            assert revision(connection) == "9999"


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
