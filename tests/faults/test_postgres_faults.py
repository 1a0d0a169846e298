"""PostgreSQL restarts, freezes and loses its network under two coordinators and three API processes."""

import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator

import pytest
from sqlalchemy import create_engine, text

from support.fleets import LEASE, Answers, Fleet, fleet
from support.processes import eventually
from support.service_processes import Service

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(600)]

#: Generations of a job of some seconds.
LONG = 300

#: A search that takes one CPU.
ALONE = {"islands": 1}

#: Longest time of an answer in seconds; docs/explanation/service.md promises it.
PROMISED = 20.0

#: Allowed types of problems. A commit whose answer was lost is in doubt.
PROBLEMS = {"no-such-job", "store-unavailable", "store-in-doubt", "not-ready"}


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    with fleet(tmp_path_factory.mktemp("fleet") / "data") as running:
        yield running


@pytest.fixture(scope="module")
def undisturbed(shared: Fleet) -> list[bytes]:
    """Models of the jobs without a fault, by seed."""
    jobs = [shared.services[0].submit(LONG, seed=seed, settings=ALONE) for seed in range(3)]
    return [shared.services[0].found(job) for job in jobs]


def query(running: Fleet, statement: str) -> list[tuple[object, ...]]:
    """Ask the database past all proxies."""
    engine = create_engine(running.database.url)
    with engine.connect() as connection:
        rows = [tuple(row) for row in connection.execute(text(statement))]
    engine.dispose()
    return rows


def kinds(service: Service, job: str) -> Counter[str]:
    """Count the kinds of the events of a finished job, which must be numbered consecutively."""
    stream = service.ask("GET", f"/v1/jobs/{job}/events").text
    events = [
        dict(line.split(": ", 1) for line in each.splitlines()) for each in stream.split("\n\n") if each
    ]
    assert [int(event["id"]) for event in events] == list(range(1, len(events) + 1))
    return Counter(event["event"] for event in events)


def check_survival(running: Fleet, undisturbed: list[bytes], name: str, fault: Callable[[], None]) -> Answers:
    """Run jobs during a fault: none is lost, duplicated or different, and no process is restarted."""
    with running.asked_continually() as answers:
        submit = [
            lambda seed=seed, service=service: service.submit(
                LONG, key=f"{name} {seed}", seed=seed, settings=ALONE
            )
            for seed, service in enumerate(running.services)
        ]
        jobs = [each() for each in submit]
        for job in jobs[:2]:
            running.services[0].under_way(job)
        again: list[str] = []
        repeated = threading.Thread(target=lambda: again.extend(each() for each in submit))
        repeated.start()
        fault()
        found = [running.services[index - 1].found(job) for index, job in enumerate(jobs)]
        repeated.join()
    assert found == undisturbed
    assert again == jobs
    assert [each.poll() for each in running.processes] == [None] * 5
    for job in jobs:
        counted = kinds(running.services[0], job)
        assert counted["queued"] >= 1
        assert counted["succeeded"] == 1, counted
    assert set(answers.statuses) <= {200, 404, 503, 504}, answers
    assert {each.removeprefix("/problems/") for each in answers.problems} <= PROBLEMS
    assert answers.slowest < PROMISED
    assert "defect" not in running.log.read_text()
    print(f"{name}: {answers}")
    return answers


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGQUIT], ids=["shutdown", "crash"])
def test_restarts_of_postgresql_lose_no_job(
    shared: Fleet, undisturbed: list[bytes], how: signal.Signals
) -> None:
    def fault() -> None:
        for _ in range(3):
            shared.database.stop(how)
            time.sleep(1.0)
            shared.database.start()
            time.sleep(1.0)

    assert check_survival(shared, undisturbed, how.name, fault).statuses[503]


@pytest.mark.parametrize("seconds", [LEASE / 3, 2 * LEASE, 18.0])
def test_frozen_postgresql_delays_jobs_only(shared: Fleet, undisturbed: list[bytes], seconds: float) -> None:
    def fault() -> None:
        with shared.database.frozen():
            time.sleep(seconds)

    check_survival(shared, undisturbed, f"frozen {seconds}", fault)


def test_connections_that_are_cut_at_any_moment_lose_no_job(shared: Fleet, undisturbed: list[bytes]) -> None:
    def fault() -> None:
        for turn in range(30):
            for proxy in shared.proxies:
                if turn % 3 == 0:
                    proxy.cut()
                elif turn % 3 == 1:
                    proxy.cut_before = b"COMMIT\0"
                else:
                    proxy.cut_after = b"COMMIT\0"
            time.sleep(0.3)

    check_survival(shared, undisturbed, "cut", fault)
    assert all(proxy.cuts > 5 for proxy in shared.proxies)


def test_coordinator_cut_off_for_longer_than_its_lease_writes_nothing(
    shared: Fleet, undisturbed: list[bytes]
) -> None:
    """Its withheld packets arrive after the takeover, and change nothing."""

    def fault() -> None:
        owners = query(shared, "SELECT id, lease_owner, lease_epoch FROM jobs WHERE state = 'running'")
        job, name, epoch = min(owners)
        proxy = shared.proxy_of(str(name))
        proxy.withhold()
        began = time.monotonic()
        eventually(lambda: query(shared, f"SELECT id FROM jobs WHERE id = '{job}' AND lease_epoch > {epoch}"))
        assert time.monotonic() - began > LEASE / 2
        proxy.resume()

    before = shared.log.read_text().count("lease lost")
    check_survival(shared, undisturbed, "one coordinator", fault)
    eventually(lambda: shared.log.read_text().count("lease lost") > before)
