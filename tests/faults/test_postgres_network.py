"""A PostgreSQL server that is silent, slow, or cut off in the middle of a transaction."""

import time
from functools import partial

import pytest

from islands_service.store import Store, timed_connection
from islands_service.store.database import CommitUnknownError, StoreUnavailableError
from islands_service.store.job_rows import update_job
from support.databases import emptied, server
from support.stores import ALICE, LONG, asked, at_once, brought_on, claimed, kinds, submitted
from support.tcp_proxy import proxied

pytestmark = pytest.mark.ci

#: A commit as psycopg sends it; the name of the isolation level contains the word, too.
COMMIT = b"COMMIT\0"


@pytest.fixture(scope="module")
def servers():
    """A PostgreSQL server for these tests only."""
    with server() as own:
        Store(own.url).close()
        yield own


@pytest.fixture
def proxy(servers):
    emptied(servers.url)
    with proxied(servers.socket) as made:
        yield made


@pytest.fixture
def store(proxy, monkeypatch):
    monkeypatch.setattr(timed_connection, "ANSWER_TIMEOUT", 0.6)
    monkeypatch.setattr(timed_connection, "PING_TIMEOUT", 0.3)
    with Store(f"postgresql+psycopg://islands@127.0.0.1:{proxy.port}/postgres?connect_timeout=2") as opened:
        yield opened


def fails_within(seconds, ask):
    """Check that an operation reports an unavailable store within a time."""
    began = time.monotonic()
    with pytest.raises(StoreUnavailableError, match=r"try again|with the same idempotency key"):
        ask()
    assert time.monotonic() - began < seconds


def test_suspended_server_raises_an_error_within_the_timeout_and_is_used_again(servers, store):
    """The kernel of a suspended server acknowledges every packet: TCP alone would wait for ever."""
    job = submitted(store)
    lease = claimed(store)
    with servers.frozen():
        answers = at_once(
            [
                partial(fails_within, 15.0, ask)
                for ask in (
                    partial(store.jobs.get, ALICE, job.id),
                    partial(submitted, store),
                    partial(store.leases.renew, lease, LONG),
                )
            ]
        )
    assert answers == [None] * 3
    assert store.jobs.get(ALICE, job.id) == lease.job
    store.leases.report(lease, brought_on(1))
    assert kinds(store, job.id) == ["queued", "running", "progress"]
    assert len(store.jobs.page(ALICE, limit=100).jobs) == 1


def test_server_that_falls_silent_within_a_transaction_has_written_nothing(store, proxy):
    job = submitted(store)

    def operation(connection):
        update_job(connection, job.id, progress='{"half": true}')
        proxy.withhold()
        update_job(connection, job.id, progress='{"whole": true}')

    fails_within(5.0, partial(store.database.write, operation))
    proxy.resume()
    assert store.jobs.get(ALICE, job.id) == job


@pytest.mark.parametrize("where", ["cut_before", "cut_after"])
def test_job_whose_commit_is_cut_off_exists_once_after_a_repeated_request(store, proxy, where):
    request = asked(idempotency_key="once")
    store.jobs.page(ALICE)  # a connection for reading
    submitted(store)
    setattr(proxy, where, COMMIT)
    with pytest.raises(CommitUnknownError):
        store.jobs.submit(request)
    written = len(store.jobs.page(ALICE, limit=100).jobs) - 1
    assert written == (where == "cut_after")
    job, new = store.jobs.submit(request)
    assert new is not bool(written)
    assert kinds(store, job.id) == ["queued"]
    assert len(store.jobs.page(ALICE, limit=100).jobs) == 2


def test_claim_whose_commit_is_cut_off_is_repeated_by_the_same_coordinator_only(store, proxy):
    job = submitted(store)
    proxy.cut_after = COMMIT
    with pytest.raises(CommitUnknownError):
        store.leases.claim("first", LONG)
    assert store.leases.claim("second", LONG) is None
    again = store.leases.claim("first", LONG)
    assert (again.job.id, again.epoch) == (job.id, 2)
