"""Discrepancy jobs of a running service: the injected effect is found, also after kills and cancellations."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.processes import descendants, eventually, kill
from support.report_pages import without_origin
from support.service import HIDDEN, KNOWN, held, hidden
from support.service_processes import Service, serving

pytestmark = pytest.mark.nightly

#: Seconds of a record whose analysis takes a while.
LONG = 150.0


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("diagnoses") / "data") as running:
        yield running


def submitted(service: Service, folder: Path, seconds: float) -> str:
    files = {"file": ("hidden.csv", hidden(folder, seconds))}
    dataset = service.ask("POST", "/v1/datasets", files=files).json()["id"]
    order = held(dataset, channels=["T_K"], tolerance=KNOWN)
    answer = service.ask("POST", "/v1/discrepancies", json=order)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def found(service: Service, job: str) -> tuple[dict[str, Any], bytes, bytes]:
    """Wait for a job, and return its result without the wall time, its report and its extended simulation."""
    ended = service.ended(job)
    assert ended["state"] == "succeeded", ended
    document, report, extended = (
        service.ask("GET", f"/v1/jobs/{job}{of}") for of in ("/result", "/report", "/extended")
    )
    result = document.json()
    assert result.pop("wall_s") > 0
    return result, without_origin(report.content), extended.content


def wait_for_checkpoint(service: Service, job: str) -> None:
    """Wait until a diagnosis has screened all effects and has a checkpoint."""
    eventually(lambda: "in addition" in str((service.job(job)["progress"] or {}).get("phase")))
    assert service.job(job)["versions"]["checkpoint"]


def known_fits(service: Service, job: str) -> list[int]:
    """Return the number of fits with which each further attempt at a diagnosis continued."""
    return [
        int(each)
        for each in re.findall(f"diagnosis continues .*fits=(\\d+) job={job}", service.log.read_text())
    ]


def test_killed_coordinator_continues_and_does_not_change_the_diagnosis(
    service: Service, tmp_path: Path
) -> None:
    undisturbed = found(service, submitted(service, tmp_path, LONG))
    job = submitted(service, tmp_path, LONG)
    wait_for_checkpoint(service, job)
    kill(service.one("coordinator"))
    assert found(service, job) == undisturbed
    assert service.job(job)["attempt"] == 2
    (known,) = known_fits(service, job)
    assert known > 0


def test_running_diagnosis_is_cancelled_within_seconds_and_continues(
    service: Service, tmp_path: Path
) -> None:
    job = submitted(service, tmp_path, LONG)
    wait_for_checkpoint(service, job)
    assert service.ask("POST", f"/v1/jobs/{job}/cancel").status_code == 202
    assert service.ended(job, seconds=5.0)["state"] == "cancelled"
    # No process continues to compute: those of the fits have another name while they are idle.
    eventually(lambda: "ray::_call" not in str(descendants(service.process.pid)), seconds=5.0)
    assert service.ask("POST", f"/v1/jobs/{job}/resume").status_code == 202
    assert [effect["name"] for effect in found(service, job)[0]["effects"]] == [HIDDEN]
    (known,) = known_fits(service, job)
    assert known > 0


def test_idle_service_keeps_no_worker_of_ray(service: Service, tmp_path: Path) -> None:
    """A worker keeps the memory of its last calls, and the local Ray keeps one for each core."""
    coordinator = service.one("coordinator")
    found(service, submitted(service, tmp_path, 4.0))
    eventually(lambda: "ray::IDLE" not in " ".join(descendants(service.process.pid).values()), seconds=30.0)
    assert service.one("coordinator") == coordinator
    assert service.one("head")
