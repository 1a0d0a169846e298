"""Comparison of models of several jobs on the dashboard."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from support.played import run_submitted
from support.reading import unreadable
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci

#: Milliseconds in which a busy machine simulates two models.
SIMULATED = 120_000


def find_runs(page: Any) -> Any:
    """Return the card of the free runs."""
    return page.locator(".card", has=page.get_by_role("heading", name="Free runs on the validation data"))


@pytest.fixture(scope="module")
def jobs(service: ServiceClient) -> tuple[str, str]:
    """Two succeeded jobs of the same record; the second one has smaller models."""
    names = [("large", {}), ("small", {"max_terms": 3})]
    first, second = (
        run_submitted(service, service.submit(5, name=name, settings=settings)) for name, settings in names
    )
    return first, second


@pytest.fixture
def compared(opened: Callable[..., Any], jobs: tuple[str, str]) -> Any:
    page = opened(f"#/compare?jobs={','.join(jobs)}", width=390, color_scheme="dark")
    page.get_by_role("heading", name="Settings that differ").wait_for()
    return page


def test_two_jobs_are_compared(
    compared: Any, service: ServiceClient, jobs: tuple[str, str], expect: Any
) -> None:
    expect(compared.get_by_text("All models have the same data.")).to_be_visible()
    for job, row in zip(jobs, compared.locator("table").first.locator("tbody tr").all(), strict=True):
        (best,) = (each for each in json.loads(service.models(job))["items"] if each["recommended"])
        expect(row).to_contain_text(f"model {best['rank']}")
        expect(row.locator("td").nth(1)).to_have_text(str(best["size"]))
    # One chart: both models have the same validation data.
    legend = find_runs(compared).locator(".legend li")
    expect(legend).to_have_count(3, timeout=SIMULATED)
    assert "large" in legend.nth(1).inner_text()
    differing = compared.locator("table").last.locator("tbody tr")
    expect(differing).to_have_count(1)
    expect(differing).to_contain_text("max_terms")
    assert unreadable(compared) == []


def test_a_comparison_names_the_models_whose_errors_belong_to_other_parameters(
    opened: Callable[..., Any], service: ServiceClient, jobs: tuple[str, str], expect: Any
) -> None:
    refitted = run_submitted(service, service.submit(5, name="again", settings={"refit": "all"}))
    page = opened(f"#/compare?jobs={jobs[0]},{refitted}")
    note = page.get_by_text("estimated again on all data after the errors were measured")
    expect(note).to_have_count(1)
    assert note.inner_text().startswith("again, model ")


def test_the_report_of_the_comparison_is_one_file_of_four_pages(
    compared: Any, quiet: Callable[..., Screen], tmp_path: Path, expect: Any
) -> None:
    # A link cannot send the key.
    expect(compared.get_by_role("link", name="Read the report")).to_have_count(0)
    with compared.expect_download(timeout=SIMULATED) as saved:
        compared.get_by_role("button", name="Save the report").click()
    assert saved.value.suggested_filename == "comparison.html"
    path = tmp_path / "comparison.html"
    saved.value.save_as(path)
    page = quiet(tmp_path.as_uri(), width=390).go(path.name)
    expect(page.locator("h1")).to_contain_text("Of 2 models, ")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.evaluate("document.images[0].naturalWidth") > 0
    printed = page.pdf(format="A4", print_background=True)
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4


def test_models_of_a_job_are_chosen_on_its_page(
    opened: Callable[..., Any], jobs: tuple[str, str], expect: Any
) -> None:
    page = opened(f"#/jobs/{jobs[0]}")
    page.get_by_text("Compare models").click()
    boxes = page.locator("details.compare input")
    for box in boxes.all():
        box.uncheck()
    expect(page.locator("details.compare a")).to_have_attribute("aria-disabled", "true")
    boxes.nth(0).check()
    boxes.nth(1).check()
    page.get_by_role("link", name="Compare", exact=True).click()
    expect(page).to_have_url(re.compile(f"#/compare\\?jobs={jobs[0]}:1,{jobs[0]}:2$"))
    expect(page.get_by_text("The jobs have the same settings.")).to_be_visible()


def test_jobs_of_different_data_and_jobs_without_a_result_are_stated(
    opened: Callable[..., Any], service: ServiceClient, jobs: tuple[str, str], expect: Any
) -> None:
    other = run_submitted(service, service.submit(5, name="rows", rows="0:300"))
    queued = service.submit(5, name="waits")
    page = opened(f"#/compare?jobs={jobs[0]},{other},{queued}")
    expect(page.get_by_text("their errors are those of different validation data")).to_be_visible()
    expect(page.locator(".complaint")).to_contain_text("waits: ")
    service.ask("POST", f"/v1/jobs/{queued}/cancel")
