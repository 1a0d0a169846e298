"""``islands jobs submit`` and ``diagnose`` in this process: submitted values and errors."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands_service.domain.job import DISCREPANCY, EXTENDED, REPORT, JobOutcome, JobState, Submission
from islands_service.store.blobs import Blobs
from support.command_line import COLUMNS
from support.service import Service, held
from support.stores import taken

Run = Callable[..., tuple[int, str, str]]


# Submit.


def test_submitted_job_is_stored_and_printed_as_json(run: Run, service: Service, owner: str) -> None:
    code, out, err = run("submit", "r.csv", *COLUMNS, "--preset", "narx", "--json")
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed["state"] == "queued"
    job = service.store.jobs.get(owner, printed["id"])
    assert (job.name, job.spec["preset"], job.spec["inputs"], job.spec["output"]) == (
        *("r.csv", "narx"),
        *(["u_V"], "y_um"),
    )
    assert service.store.datasets.get(owner, job.spec["dataset"]).name == "r.csv"
    assert set(job.spec) == {
        "dataset",
        "inputs",
        "output",
        "preset",
        "seed",
    }  # options that are not given are not sent


# Discrepancy jobs.


@pytest.fixture
def diagnosed(service: Service, owner: str) -> str:
    """A succeeded discrepancy job."""
    spec = held("0-csv")
    job = service.store.jobs.submit(Submission(owner, spec, DISCREPANCY, "piezo", priority=100))[0].id
    blobs = Blobs(service.settings.blobs)
    summary = {
        "verdict": "named",
        "effects": ["thermal-drift"],
        "words": "It lacks something.\n  thermal-drift",
    }
    document = {"verdict": "named", "extended_model": "extended.json", "wall_s": 1.5}
    artefacts = {REPORT: blobs.write(b"<!DOCTYPE html>"), EXTENDED: blobs.write(b'{"effects": []}')}
    found = JobOutcome(JobState.SUCCEEDED, document, summary=summary, artefacts=artefacts)
    service.store.leases.finish(taken(service.store, job), found)
    return job


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--simulation", "pendulum"), "unknown simulation 'pendulum'"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "dp"), "tolerance is NAME=VALUE"),
        (("--simulation", "bouc-wen-piezo", "--input", "t_s"), "is driven by one input, got u_V, t_s"),
        (("--simulation", "column:y_sim"), "has no column y_sim"),
        (("--simulation", "python:a.py:run"), "a service does not run code of its clients"),
    ],
)
def test_invalid_diagnosis_is_rejected_in_one_line(run: Run, arguments: Any, message: str) -> None:
    code, out, err = run("diagnose", "r.csv", *COLUMNS, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_diagnosis_is_watched_listed_and_shown_as_text(run: Run, diagnosed: str) -> None:
    words = "It lacks something.\n  thermal-drift\n"
    assert run("show", diagnosed, "--watch")[1] == words
    assert run("show", diagnosed)[1] == f"job {diagnosed}: succeeded\n{words}"
    first, second = run("show")[1].splitlines()[2:4]
    assert first.startswith(diagnosed)
    assert second.endswith("piezo (named: thermal-drift)")


def test_downloaded_diagnosis_equals_that_of_the_command_line(run: Run, diagnosed: str) -> None:
    Path("out").mkdir()
    Path("out/notes.txt").write_text("notes")
    code, out, err = run("show", diagnosed, "--out", "out")
    assert code == 0, err
    assert out.splitlines()[-1].startswith("out/: discrepancy.json, report.html, extended.json")
    names = {"discrepancy.json", "report.html", "extended.json", "notes.txt"}
    assert {path.name for path in Path("out").iterdir()} == names
    document = json.loads(Path("out/discrepancy.json").read_text())
    assert document == json.loads(run("show", diagnosed, "--json")[1])["result"]
    assert Path("out/extended.json").read_bytes() == b'{"effects": []}'
    code, _, err = run("show", diagnosed, "--out", "out")
    assert code == 2
    assert "holds a result already" in err
    assert run("show", diagnosed, "--out", "out", "--force")[0] == 0
