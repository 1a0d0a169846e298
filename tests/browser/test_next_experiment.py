"""Next experiment on the page of a diagnosis: the separations, and the input as a plot and as a file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from islands.records.writer import input_csv
from islands_service.domain.job import NEXT_EXPERIMENT, JobOutcome, JobState
from islands_service.store.blobs import Blobs
from support.canvas import DRAWN
from support.diagnosis_documents import CAUSE, make_document
from support.played import stored
from support.processes import eventually
from support.reading import unreadable
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

pytestmark = pytest.mark.ci

#: The input, and its text.
INPUT = np.sin(np.arange(400) / 10)
CSV = input_csv(INPUT, 0.01, "u_V")

SEPARATION = {
    "distance": 7.3,
    "required_distance": 4.5,
    "expected_log_likelihood_ratio": 53.3,
    "is_sufficient": True,
}

EXPERIMENT = {
    "pairs": [
        {
            "causes": ["delay", "sensor-lag"],
            "recorded": {**SEPARATION, "distance": 0.8, "is_sufficient": False},
            "predicted": SEPARATION,
            "repeats": 1,
        }
    ],
    "input": {
        "description": "sweep from 0.1 to 4 Hz, amplitude 1 V",
        "name": "u_V",
        "unit": "V",
        "samples": INPUT.size,
        "dt": 0.01,
        "limits": {"lower": -1.0, "upper": 1.0, "rate": 10.0},
        "recorded_limits": {"lower": -1.0, "upper": 1.0, "rate": 2.5},
        "is_within_record": False,
        "range_excess": 1.0,
        "rate_excess": 4.0,
        "file": NEXT_EXPERIMENT,
    },
}


def finish(desk: ServiceClient, experiment: dict[str, Any]) -> str:
    order = {
        "dataset": desk.dataset,
        "input": "u_V",
        "output": "y_um",
        "simulation": {"kind": "second-order"},
    }
    job = str(desk.ask("POST", "/v1/discrepancies", json=order).json()["id"])
    result = make_document(
        "named",
        effects=[{**CAUSE, "equivalents": ["sensor-lag"]}],
        candidates=[{"name": "delay", "score": 40.0, "eta": 0.99}],
        decisive_experiment="delay or sensor-lag: no input separates them",
        next_experiment=experiment,
    )
    summary = {
        "verdict": "named",
        "effects": ["delay"],
        "reduction_percent": None,
        "words": "The delay is named.",
    }
    artefacts = {NEXT_EXPERIMENT: Blobs(desk.folder / "blobs").write(CSV.encode())}
    with stored(desk) as store:
        outcome = JobOutcome(JobState.SUCCEEDED, result, summary=summary, artefacts=artefacts)
        store.leases.finish(taken(store, job), outcome)
    return job


def test_the_input_is_described_drawn_and_saved(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any, tmp_path: Path
) -> None:
    job = finish(desk, EXPERIMENT)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    section = page.locator(".next-experiment")
    expect(section.locator("tbody tr")).to_have_text(["delay or sensor-lag0.87.34.51"])
    expect(section.locator(".facts")).to_contain_text("10.0 V/s, 4.00 times that of the record")
    expect(section.locator(".facts")).to_contain_text("1.00 V, within the record")
    eventually(lambda: section.locator("canvas").evaluate(DRAWN) > 100)
    section.get_by_role("slider").press("End")
    with page.expect_download() as saved:
        section.get_by_role("button", name="Save the input").click()
    assert saved.value.suggested_filename == f"next-experiment-{job[:8]}.csv"
    saved.value.save_as(tmp_path / "input.csv")
    assert (tmp_path / "input.csv").read_text() == CSV


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_the_section_is_readable(
    quiet: Callable[..., Screen], desk: ServiceClient, tmp_path: Path, scheme: str, width: int
) -> None:
    page = quiet(desk.url, width, 800, color_scheme=scheme).go(f"#/jobs/{finish(desk, EXPERIMENT)}")
    page.locator(".next-experiment canvas").wait_for()
    assert unreadable(page) == []
    eventually(lambda: page.locator(".next-experiment canvas").evaluate(DRAWN) > 100)
    page.locator(".next-experiment").screenshot(path=tmp_path / f"{scheme}.png")
