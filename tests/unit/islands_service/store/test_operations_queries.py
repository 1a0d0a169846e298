"""Query plans: frequent queries use an index, whatever the number of jobs."""

import json
import random
import shutil

import pytest
from sqlalchemy import event, insert, text, update

from islands_service.domain.job import JobState
from islands_service.store import Store
from islands_service.store.tables import jobs
from support.stores import ALICE, BOB, EXPIRED, LONG, asked

JOBS = 2000

#: Frequent queries, and the index that SQLite must use for the slowest part.
ASKED = {
    "claim": (lambda store: store.leases.claim("first", LONG), "ix_jobs_queue"),
    "quota": (lambda store: store.jobs.submit(asked(), 10**6), "ix_jobs_queue"),
    "key": (lambda store: store.jobs.submit(asked(idempotency_key="k")), "sqlite_autoindex_jobs_2"),
    "page": (lambda store: store.jobs.page(ALICE), "ix_jobs_owner_created_id"),
    "next page": (lambda store: store.jobs.page(ALICE, None, (5.0, "f")), "ix_jobs_owner_created_id"),
    "page of a state": (
        lambda store: store.jobs.page(ALICE, JobState.FAILED),
        "ix_jobs_owner_state_created_id",
    ),
    "next of a state": (
        lambda store: store.jobs.page(ALICE, JobState.FAILED, (5.0, "f")),
        "ix_jobs_owner_state_created_id",
    ),
    "page of a kind": (lambda store: store.jobs.page(ALICE, kind="discrepancy"), "ix_jobs_owner_created_id"),
    "page of a tag": (lambda store: store.jobs.page(ALICE, tag="rig 2"), "ix_jobs_owner_created_id"),
    "page of words": (lambda store: store.jobs.page(ALICE, words=["no", "such"]), "ix_jobs_owner_created_id"),
    "page by error": (lambda store: store.jobs.page(ALICE, by_error=True), "ix_jobs_model_error"),
    "next by error": (
        lambda store: store.jobs.page(ALICE, None, (5.0, "f"), by_error=True),
        "ix_jobs_model_error",
    ),
    "events": (lambda store: store.jobs.events("0" * 32, 3), "sqlite_autoindex_events_1"),
    "versions": (lambda store: store.jobs.versions(["0" * 32] * 50), "sqlite_autoindex_jobs_1"),
    "history": (lambda store: store.results.history("0" * 32, 3), "sqlite_autoindex_points_1"),
    "models": (lambda store: store.results.models("0" * 32, 1), "sqlite_autoindex_models_1"),
    "key of a secret": (lambda store: store.keys.find("islands_"), "sqlite_autoindex_keys_2"),
    "data sets": (lambda store: store.datasets.page(ALICE), "sqlite_autoindex_datasets_1"),
}


def rows(count):
    rng = random.Random(5)
    for number in range(count):
        yield {
            "id": f"{rng.getrandbits(128):032x}",
            "owner": rng.choice([ALICE, BOB]),
            "kind": "identification",
            "name": "",
            "spec": json.dumps({"seed": number}),
            "request_sha256": "0" * 64,
            "priority": rng.choice([-1, 0, 0, 0, 1]),
            "state": rng.choice(["queued", "running", *["succeeded"] * 8]),
            "lease_until": EXPIRED,
            "created": float(number),
            "updated": float(number),
        }


def filled(store):
    store.database.write(lambda connection: connection.execute(insert(jobs), list(rows(JOBS))))
    return store


@pytest.fixture
def full(store):
    """A store with many jobs, most of them finished."""
    return filled(store)


@pytest.fixture(scope="module")
def filled_file(prepared_sqlite, tmp_path_factory):
    """A file with the same jobs, to be copied."""
    path = shutil.copyfile(prepared_sqlite, tmp_path_factory.mktemp("store") / "filled.db")
    with Store(f"sqlite:///{path}") as store:
        filled(store)
    return path


@pytest.fixture
def sqlite(filled_file, tmp_path):
    """The same in SQLite only, which chooses its plans without statistics."""
    with Store(f"sqlite:///{shutil.copyfile(filled_file, tmp_path / 'islands.db')}") as store:
        yield store


def plans(store, ask):
    """Return the query plans of the statements that a call executes."""
    engine, seen = store.database.engine, []

    def executed(connection, cursor, statement, parameters, context, many):
        if statement.startswith(("SELECT", "WITH", "UPDATE", "DELETE")) and "advisory" not in statement:
            seen.append((statement, parameters))

    event.listen(engine, "before_cursor_execute", executed)
    try:
        ask(store)
    finally:
        event.remove(engine, "before_cursor_execute", executed)
    found = []
    with store.database.read() as connection:
        if connection.dialect.name == "postgresql":
            # PostgreSQL would scan a table that fits into a few pages: show the plan for a large one.
            connection.execute(text("SET LOCAL enable_seqscan = off"))
        word = "EXPLAIN QUERY PLAN " if connection.dialect.name == "sqlite" else "EXPLAIN "
        for statement, parameters in seen:
            answer = connection.exec_driver_sql(word + statement, parameters)
            found.append("\n".join(str(row[-1]) for row in answer))
    return found


@pytest.mark.parametrize("ask", ASKED)
def test_frequent_query_reads_its_intended_index(sqlite, ask):
    action, index = ASKED[ask]
    assert any(index in plan for plan in plans(sqlite, action))


@pytest.mark.parametrize(
    "ask",
    [
        *("page", "next page", "page of a state", "next of a state", "page of a kind", "page of a tag"),
        *("page of words", "page by error", "next by error", "events", "history"),
    ],
)
def test_ordered_query_needs_no_sort(sqlite, ask):
    assert "TEMP B-TREE" not in "\n".join(plans(sqlite, ASKED[ask][0]))


def test_claim_ranks_owners_in_the_index_and_reads_the_jobs_of_one_in_order(full):
    """A sort of 20 000 queued jobs takes 20 ms, for which other writes wait."""

    def prepare(connection):
        connection.execute(update(jobs).values(lease_until=1e12))
        if connection.dialect.name == "postgresql":
            connection.execute(text("ANALYZE jobs"))

    full.database.write(prepare)
    _, owners, first, _ = plans(full, ASKED["claim"][0])
    if full.database.engine.dialect.name == "sqlite":
        assert "COVERING INDEX ix_jobs_queue (state=? AND owner>?)" in owners
        assert "jobs USING INDEX" not in owners
    assert "ix_jobs_queue" in first
    assert "TEMP B-TREE" not in first
    assert "Sort" not in first
