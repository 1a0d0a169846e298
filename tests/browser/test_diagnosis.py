"""Page of a discrepancy job; the test acts as the coordinator."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from islands_service.domain.job import EXTENDED, OUTPUTS, REPORT, JobOutcome, JobState, ProgressReport
from islands_service.domain.plot_envelopes import write_outputs
from islands_service.store.blobs import Blobs
from support.diagnosis_documents import CAUSE, GAIN, make_document
from support.played import stored
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

pytestmark = pytest.mark.ci

WORDS = (
    "The simulation lacks something `<b>that has a name</b>`.\n  thermal-drift: k = 1 um/K\nThe RMSE falls."
)

#: The headline without the last sentence, which belongs to the details.
HEADLINE = "\n".join(line.strip() for line in WORDS.split("\n")[:2])

SUMMARY = {
    "verdict": "named",
    "effects": ["thermal-drift"],
    "reduction_percent": 64.3,
    "headline": HEADLINE,
    "words": WORDS,
}

#: A named cause that another one equals, a worse cause, and one that worsens the fit.
CANDIDATES = [
    {"name": "thermal-drift", "score": 40.0, "eta": 0.99},
    {"name": "linear-drift", "score": 10.0, "eta": 0.5},
    {"name": "jump", "score": -2.0, "eta": 0.0},
]

RESULT = make_document(
    "named",
    effects=[{**CAUSE, "name": "thermal-drift", "equivalents": ["exponential-creep"]}],
    gain=GAIN,
    candidates=CANDIDATES,
    estimation_samples=300,
    decisive_experiment="hold the input",
    titles={"thermal-drift": "thermal drift of the output"},
)
RESULT["record"] |= {"samples": 400, "dt": 0.01}

PAGE = b"<!DOCTYPE html><title>piezo.csv: named</title><h1>piezo.csv against bouc-wen-piezo</h1>"


def make_outcome(desk: ServiceClient, **summary: Any) -> JobOutcome:
    """Return the outcome of a diagnosis, with a stored report."""
    blobs = Blobs(desk.folder / "blobs")
    output = np.sin(np.arange(400) / 20)
    outputs = write_outputs(output, {"simulated": 0.8 * output, "extended": 0.99 * output})
    artefacts = {
        REPORT: blobs.write(PAGE),
        EXTENDED: blobs.write(b"{}"),
        OUTPUTS: blobs.write(outputs),
    }
    return JobOutcome(JobState.SUCCEEDED, RESULT, summary={**SUMMARY, **summary}, artefacts=artefacts)


def submit_diagnosis(desk: ServiceClient, **changes: Any) -> str:
    spec = {"dataset": desk.dataset, "input": "u_V", "output": "y_um", "tolerance": {"dp": 0.01}}
    simulation = {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.5}}
    answer = desk.ask("POST", "/v1/discrepancies", json={**spec, "simulation": simulation, **changes})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def test_the_page_of_a_diagnosis_shows_progress_and_result(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any, tmp_path: Path
) -> None:
    job = submit_diagnosis(desk, name="piezo")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    with stored(desk) as store:
        lease = taken(store, job)
        store.leases.report(
            lease,
            ProgressReport(
                {"phase": "looking for each of 32 effects", "fraction": 0.3, "seconds_left": 14.0}
            ),
        )
        expect(page.locator(".doing")).to_have_text("Looking for each of 32 effects.")
        # The sentence is not repeated at the bar.
        expect(page.locator(".status .progress-text")).to_be_hidden()
        assert page.locator(".status progress").evaluate("bar => bar.value") == pytest.approx(0.3)
        expect(page.locator(".status .facts")).to_contain_text(re.compile(r"about \d+(\.\d)? s"))
        store.leases.finish(lease, make_outcome(desk))
    expect(page.locator(".status .progress-text")).to_have_text("named: thermal-drift")
    findings = page.locator(".findings")
    expect(findings.locator(":scope > p")).to_have_text(HEADLINE.replace("`", "").split("\n"))
    expect(page.locator(".sentences p")).to_have_text("The RMSE falls.")
    assert page.locator(".findings b, .sentences b").count() == 0
    page.get_by_text("Monitor later records").click()
    training = page.get_by_label("Records of the training")
    expect(training).to_have_value("24")
    expect(training).to_have_attribute("min", "12")
    facts = page.locator(".about .facts").first
    expect(facts).to_contain_text("bouc-wen-piezo: dp = 1.5")
    expect(facts).to_contain_text("Tolerance of dp1 %")
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="Read the report").click()
    expect(opened.value.get_by_role("heading", level=1)).to_have_text("piezo.csv against bouc-wen-piezo")
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the report").click()
    saved.value.save_as(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == PAGE
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the extended simulation").click()
    assert saved.value.suggested_filename == f"extended-{job[:8]}.json"


@pytest.fixture
def finished(desk: ServiceClient) -> str:
    """A succeeded diagnosis."""
    job = submit_diagnosis(desk)
    with stored(desk) as store:
        store.leases.finish(taken(store, job), make_outcome(desk))
    return job


def test_the_values_of_all_outputs_are_read_with_the_keys(
    quiet: Callable[..., Screen], desk: ServiceClient, finished: str, expect: Any
) -> None:
    page = quiet(desk.url).go(f"#/jobs/{finished}")
    plot = page.get_by_role("slider", name="Record")
    plot.press("ArrowRight")
    names = r"measured \S+, simulated \S+, extended \S+, residual simulated \S+, residual extended \S+"
    expect(plot).to_have_attribute("aria-valuetext", re.compile(rf"^0\.04 s: {names}$"))


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_page_of_a_finished_diagnosis_is_readable(
    quiet: Callable[..., Screen], desk: ServiceClient, finished: str, scheme: str, width: int
) -> None:
    page = quiet(desk.url, width, 800, color_scheme=scheme).go(f"#/jobs/{finished}")
    page.locator("table.causes").wait_for()
    assert unreadable(page) == []
