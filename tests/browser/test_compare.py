"""Comparison of models of several jobs on the dashboard."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from support.played import run_submitted
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def jobs(service: ServiceClient) -> tuple[str, str]:
    """Two succeeded jobs of the same record; the second one has smaller models."""
    names = [("large", {}), ("small", {"max_terms": 3})]
    first, second = (
        run_submitted(service, service.submit(5, name=name, settings=settings)) for name, settings in names
    )
    return first, second


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
