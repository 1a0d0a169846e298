"""PostgreSQL servers that stop and restart, and processes that are suspended while they hold locks."""

import os
import signal
import threading
import time

import pytest

from islands_service.domain.job import JobState, LeaseLostError
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from islands_service.store.job_rows import append_event, update_job
from support.databases import emptied, is_available, server
from support.processes import eventually
from support.stores import ALICE, EXPIRED, LONG, brought_on, claimed, kinds, stopped_writer, submitted


def test_postgresql_claim_skips_a_job_that_is_being_written(prepared_postgres):
    database = emptied(prepared_postgres)
    with Store(database) as store:
        submitted(store)
        with stopped_writer(database, seconds=60):
            assert store.leases.claim("second", LONG) is None
            other = submitted(store)
            assert claimed(store).job.id == other.id


def test_postgresql_ends_the_transaction_of_a_stopped_process(prepared_postgres):
    database = emptied(prepared_postgres)
    with Store(database) as store:
        job = submitted(store)
        with stopped_writer(database, seconds=1) as process:
            # The server ends the transaction of the suspended process.
            assert eventually(lambda: store.leases.claim("second", LONG)).job.id == job.id
            os.kill(process.pid, signal.SIGCONT)
            # The process notices at the commit, and cannot know that nothing was written.
            assert process.stdout.readline().startswith("CommitUnknownError")
            assert store.jobs.get(ALICE, job.id).progress is None


@pytest.fixture(scope="module")
def servers():
    """A PostgreSQL server for these tests only."""
    with server() as own:
        Store(own.url).close()
        yield own


@pytest.fixture
def restartable(servers):
    """A running PostgreSQL server that may be stopped and started."""
    if not is_available(servers.url):
        servers.start()
    emptied(servers.url)
    return servers


@pytest.mark.parametrize(
    "how",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.nightly, id="shutdown"),
        pytest.param(signal.SIGQUIT, marks=pytest.mark.ci, id="crash"),
    ],
)
def test_stopped_postgresql_raises_errors_and_is_used_after_a_restart(restartable, how):
    with Store(restartable.url) as store:
        job = submitted(store)
        lease = claimed(store)
        restartable.stop(how)
        for ask in (
            lambda: store.jobs.get(ALICE, job.id),
            lambda: submitted(store),
            lambda: store.leases.renew(lease, LONG),
            lambda: store.leases.claim("another", LONG),
        ):
            for _ in range(2):
                began = time.monotonic()
                with pytest.raises(StoreUnavailableError, match="try again"):
                    ask()
                assert time.monotonic() - began < 20
        with pytest.raises(StoreUnavailableError):
            Store(restartable.url)
        assert not is_available(restartable.url)
        restartable.start()
        assert store.jobs.get(ALICE, job.id) == lease.job
        store.leases.report(lease, brought_on(1))
        assert kinds(store, submitted(store).id) == ["queued"]


@pytest.mark.ci
def test_acknowledged_jobs_survive_a_crash_of_postgresql(restartable):
    over, acknowledged, failed = threading.Event(), [], []
    with Store(restartable.url) as store:

        def submit():
            while not over.is_set():
                try:
                    acknowledged.append(submitted(store).id)
                except StoreUnavailableError:
                    failed.append(1)
                    over.wait(0.01)

        threads = [threading.Thread(target=submit) for _ in range(4)]
        for thread in threads:
            thread.start()
        for _ in range(3):
            seen = len(acknowledged)
            eventually(lambda seen=seen: len(acknowledged) >= seen + 30)
            restartable.stop(signal.SIGQUIT)
            seen_failures = len(failed)
            eventually(lambda seen=seen_failures: len(failed) > seen)
            restartable.start()
        over.set()
        for thread in threads:
            thread.join()
        assert failed
        for job in acknowledged:
            assert kinds(store, job) == ["queued"]


def test_read_only_postgresql_counts_as_unavailable(prepared_postgres):
    """After a failover the former primary server may be a standby."""
    with Store(emptied(prepared_postgres)) as store:
        job = submitted(store)

        def only_read(connection):
            connection.exec_driver_sql("SET TRANSACTION READ ONLY")
            append_event(connection, update_job(connection, job.id), "touched")

        with pytest.raises(StoreUnavailableError):
            store.database.write(only_read)
        assert store.jobs.get(ALICE, job.id).state == JobState.QUEUED


@pytest.mark.ci
def test_lease_expired_during_an_outage_is_valid_until_the_next_claim(restartable):
    with Store(restartable.url) as store, Store(restartable.url) as other:
        submitted(store)
        lease = claimed(store, EXPIRED)
        restartable.stop(signal.SIGQUIT)
        restartable.start()
        assert not store.leases.renew(lease, EXPIRED).cancel_requested
        taken = claimed(other)
        assert taken.job.id == lease.job.id
        with pytest.raises(LeaseLostError):
            store.leases.renew(lease, LONG)
