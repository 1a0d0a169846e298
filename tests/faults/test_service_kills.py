"""Each process of a service is killed during a job: no job is lost, and the models are the same."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from islands.evolution.engine import SerialEngine
from islands.facade.identify import identify
from islands.records.reading import read_record
from islands.report.documents.result_folder import result_document
from islands_service.intake.confined_process import ENVIRONMENT
from support.control_groups import memory_limit
from support.processes import alive, descendants, eventually, kill
from support.service_client import SPEC
from support.service_processes import ROLES, Service, serving

#: Generations of the job that is disturbed.
LONG = 200

#: Generations of a job that is queued behind it.
SHORT = 5

#: Role that is killed on every change; killed islands are also in `test_lost_actors`.
ESSENTIAL = "coordinator"

#: Allowed numbers of attempts. A coordinator that loses Ray exits, unless the job ends before it notices. The
#: loss of the API or of an island does not affect the coordinator.
ATTEMPTS = {
    "api": {1},
    "coordinator": {2},
    "reader": {1},
    "head": {2},
    "raylet": {1, 2},
    "gcs": {1, 2},
    "island": {1},
}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("kills") / "data") as running:
        yield running


@pytest.fixture(scope="module")
def undisturbed(service: Service) -> tuple[bytes, bytes]:
    """Models of the long and of the short job without disturbances."""
    jobs = [service.submit(generations) for generations in (LONG, SHORT)]
    long, short = map(service.found, jobs)
    assert long != short
    return long, short


def kinds(service: Service, job: str) -> list[str]:
    """Return the kinds of the events of a finished job, which must be numbered consecutively."""
    text = service.ask("GET", f"/v1/jobs/{job}/events").text
    events = [
        dict(line.split(": ", 1) for line in event.splitlines()) for event in text.split("\n\n") if event
    ]
    numbers = [int(event["id"]) for event in events]
    assert numbers == list(range(1, len(events) + 1))
    return [event["event"] for event in events]


@pytest.mark.nightly
def test_service_finds_the_models_of_one_process(service: Service, undisturbed: tuple[bytes, bytes]) -> None:
    record = read_record(service.folder.with_suffix(".csv"), SPEC["inputs"], SPEC["output"])
    settings = {**SPEC["settings"], "generations": SHORT}
    alone = identify(record, preset="hysteresis", seed=SPEC["seed"], engine=SerialEngine(), **settings)
    expected = result_document(alone.search_result)["models"]
    assert json.loads(undisturbed[1])["items"] == json.loads(json.dumps(expected))


@pytest.mark.nightly
@pytest.mark.parametrize("role", ["api", "coordinator", "island"])
def test_process_that_reaches_its_memory_limit_loses_no_job(
    service: Service, undisturbed: tuple[bytes, bytes], role: str
) -> None:
    """The kernel kills it in the middle of an allocation."""
    job = service.submit(LONG, key=f"memory {role}")
    service.under_way(job)
    victim = service.one(role)

    def ended() -> bool:
        with suppress(httpx.TransportError):  # an upload, so that the API allocates
            service.client.post("/v1/datasets", files={"file": ("noise.csv", bytes(10_000_000))})
        return not alive([victim])

    with memory_limit(victim, 100_000):
        eventually(ended)
    assert service.found(job) == undisturbed[0]
    assert service.job(job)["attempt"] in ATTEMPTS[role]


@pytest.mark.parametrize(
    "role",
    [
        pytest.param(role, marks=pytest.mark.ci if role == ESSENTIAL else pytest.mark.nightly)
        for role in ROLES
    ],
)
def test_killed_process_loses_no_job(service: Service, undisturbed: tuple[bytes, bytes], role: str) -> None:
    job = service.submit(LONG, key=f"long {role}")
    waiting = service.submit(SHORT, key=f"short {role}")
    assert service.under_way(job) < LONG
    victim = service.one(role)
    kill(victim)
    eventually(lambda: not alive([victim]))
    assert service.found(job) == undisturbed[0]
    assert service.found(waiting) == undisturbed[1]
    assert service.submit(LONG, key=f"long {role}") == job
    assert service.submit(SHORT, key=f"short {role}") == waiting
    happened = kinds(service, job)
    assert happened.count("queued") == happened.count("succeeded") == 1, happened
    assert happened[-1] == "succeeded"
    assert happened.count("running") in ATTEMPTS[role], happened


def submit_latent(service: Service) -> str:
    settings = {"population": 4, "generations": 24, "migrate_every": 1}
    columns = {"inputs": SPEC["inputs"], "output": SPEC["output"], "rows": "0:500"}
    spec = {"dataset": service.dataset, **columns, "preset": "latent", "settings": settings}
    answer = service.ask("POST", "/v1/jobs", json=spec)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


@pytest.mark.nightly
def test_killed_coordinator_does_not_change_a_search_for_latent_models(service: Service) -> None:
    undisturbed = service.found(submit_latent(service))
    job = submit_latent(service)
    assert service.under_way(job, 6) < 24
    victim = service.one(ESSENTIAL)
    kill(victim)
    eventually(lambda: not alive([victim]))
    assert service.found(job) == undisturbed
    assert service.job(job)["attempt"] in ATTEMPTS[ESSENTIAL]


@pytest.mark.nightly
def test_killed_service_leaves_no_process_and_continues_after_a_start(
    tmp_path: Path, undisturbed: tuple[bytes, bytes]
) -> None:
    folder = tmp_path / "data"
    with serving(folder) as first:
        job = first.submit(LONG, key="long")
        waiting = first.submit(SHORT, key="short")
        first.under_way(job)
        children = descendants(first.process.pid)
        kill(first.process.pid)
        first.process.wait()
        # Start at once, as a user would: processes of the first service are still ending.
        with serving(folder, port=first.client.base_url.port) as second:
            assert second.job(job)["state"] in ("queued", "running")
            assert second.found(job) == undisturbed[0]
            assert second.found(waiting) == undisturbed[1]
            assert second.submit(LONG, key="long") == job
    eventually(lambda: not alive(children), seconds=120.0)


@pytest.mark.ci
def test_an_upload_after_a_killed_reader_waits_for_the_next_one(service: Service) -> None:
    reader = service.one("reader")
    kill(reader)
    eventually(lambda: not alive([reader]))
    record = service.folder.with_suffix(".csv").read_bytes() + b"\n"
    uploaded = service.client.post("/v1/datasets", files={"file": ("again.csv", record)}, timeout=60.0)
    assert uploaded.status_code == 201, uploaded.text
    assert service.one("reader") != reader


@pytest.mark.ci
def test_the_reader_of_a_service_has_no_secret_of_it(service: Service) -> None:
    environment = Path(f"/proc/{service.one('reader')}/environ").read_bytes().decode().split("\0")
    names = {entry.partition("=")[0] for entry in environment if entry}
    assert names == {*ENVIRONMENT, "ISLANDS_READERS", "ISLANDS_LIFELINE"}
