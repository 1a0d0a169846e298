"""Comparison of models of several jobs on the dashboard."""

import json
import re
from collections.abc import Callable
from typing import Any

import pytest

from support.played import run_submitted
from support.reading import unreadable
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


@pytest.mark.nightly
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
