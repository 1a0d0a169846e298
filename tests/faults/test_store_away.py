"""A PostgreSQL that goes away and comes back, and those who stand still while they hold something of it."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import pytest

from islands_service.domain.job import JobState, LeaseLostError
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from islands_service.store.job_events import append_event, update_job
from support.databases import answers, emptied, server
from support.processes import eventually
from support.repository import ROOT
from support.stores import ALICE, EXPIRED, LONG, brought_on, claimed, kinds, standing, submitted


def test_on_postgresql_a_job_in_the_middle_of_a_write_is_passed_over(prepared_postgres):
    database = emptied(prepared_postgres)
    with Store(database) as store:
        submitted(store)
        with standing(database, seconds=60):
            assert store.leases.claim("second", LONG) is None
            other = submitted(store)
            assert claimed(store).job.id == other.id


def test_on_postgresql_a_process_that_stands_still_in_the_middle_of_a_write_lets_go(prepared_postgres):
    database = emptied(prepared_postgres)
    with Store(database) as store:
        job = submitted(store)
        with standing(database, seconds=1) as process:
            # The server ends the transaction of the process that stands still.
            assert eventually(lambda: store.leases.claim("second", LONG)).job.id == job.id
            os.kill(process.pid, signal.SIGCONT)
            # The connection is found dead before the commit, or in it.
            assert process.stdout.readline().startswith("StoreUnavailableError")
            assert store.jobs.get(ALICE, job.id).progress is None


#: Runs in a network of its own, and cuts it.
CUT = """
import subprocess, sys, time
sys.path.insert(0, sys.argv[1])
from support.databases import server
from support.stores import ALICE, submitted
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
def network(state):
    subprocess.run(["ip", "link", "set", "lo", state], check=True)
def told(ask):
    began = time.monotonic()
    try:
        ask()
    except StoreUnavailableError:
        print(time.monotonic() - began, flush=True)
network("up")
with server(listen_addresses="127.0.0.1") as far:
    with Store("postgresql+psycopg://islands@127.0.0.1/postgres") as store:
        job = submitted(store)
        network("down")
        told(lambda: store.jobs.get(ALICE, job.id))
        told(lambda: submitted(store))
        network("up")
        assert store.jobs.get(ALICE, job.id) == job
        submitted(store)
        print("back", flush=True)
"""


@pytest.fixture(scope="module")
def mortals():
    """A PostgreSQL of these tests alone."""
    with server() as own:
        Store(own.url).close()
        yield own


@pytest.fixture
def mortal(mortals):
    """A PostgreSQL to be stopped and started."""
    if not answers(mortals.url):
        mortals.start()
    emptied(mortals.url)
    return mortals


@pytest.mark.parametrize(
    "how",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.nightly, id="in good order"),
        pytest.param(signal.SIGQUIT, marks=pytest.mark.ci, id="as in a crash"),
    ],
)
def test_a_postgresql_that_goes_away_is_told_and_used_again_when_it_is_back(mortal, how):
    with Store(mortal.url) as store:
        job = submitted(store)
        lease = claimed(store)
        mortal.stop(how)
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
            Store(mortal.url)
        assert not answers(mortal.url)
        mortal.start()
        assert store.jobs.get(ALICE, job.id) == lease.job
        store.leases.report(lease, brought_on(1))
        assert kinds(store, submitted(store).id) == ["queued"]


@pytest.mark.ci
def test_what_a_postgresql_that_crashes_has_acknowledged_is_there(mortal):
    over, acknowledged, failed = threading.Event(), [], []
    with Store(mortal.url) as store:

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
            mortal.stop(signal.SIGQUIT)
            told = len(failed)
            eventually(lambda told=told: len(failed) > told)
            mortal.start()
        over.set()
        for thread in threads:
            thread.join()
        assert failed
        for job in acknowledged:
            assert kinds(store, job) == ["queued"]


def test_a_postgresql_that_may_only_be_read_is_told_as_one_that_is_away(prepared_postgres):
    """After its place was taken by another one it is a copy."""
    with Store(emptied(prepared_postgres)) as store:
        job = submitted(store)

        def only_read(connection):
            connection.exec_driver_sql("SET TRANSACTION READ ONLY")
            append_event(connection, update_job(connection, job.id), "touched")

        with pytest.raises(StoreUnavailableError):
            store.database.write(only_read)
        assert store.jobs.get(ALICE, job.id).state == JobState.QUEUED


@pytest.mark.ci
def test_a_lease_that_ran_out_while_the_database_was_away_is_lost_only_to_somebody(mortal):
    with Store(mortal.url) as store, Store(mortal.url) as other:
        submitted(store)
        lease = claimed(store, EXPIRED)
        mortal.stop(signal.SIGQUIT)
        mortal.start()
        assert store.leases.renew(lease, EXPIRED) is False
        taken = claimed(other)
        assert taken.job.id == lease.job.id
        with pytest.raises(LeaseLostError):
            store.leases.renew(lease, LONG)


@pytest.mark.nightly
@pytest.mark.skipif(
    os.getuid() != 0 or shutil.which("unshare") is None or shutil.which("ip") is None,
    reason="a network to cut needs root, unshare and ip",
)
def test_a_postgresql_behind_a_cut_network_is_told_in_seconds_and_used_again_afterwards(mortals):
    """Nothing comes back from there, not even a refusal: TCP by itself would wait for many minutes."""
    tests = ROOT / "tests"
    command = ["unshare", "--net", sys.executable, "-c", CUT, tests]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    read, written, back = done.stdout.split()
    assert back == "back"
    assert float(read) < 20
    assert float(written) < 20
