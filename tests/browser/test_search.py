"""Search executed by a coordinator, followed and cancelled on the dashboard."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from support.screen import Screen
from support.service_processes import Service, serving

pytestmark = pytest.mark.nightly

#: Records every state that a badge shows.
RECORD_STATES = """(selector) => {
  const badge = document.querySelector(selector);
  window.noted = [badge.textContent];
  new MutationObserver(() => window.noted.push(badge.textContent)).observe(badge, { childList: true });
}"""


@pytest.fixture(scope="module")
def desk(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service with a coordinator."""
    with serving(tmp_path_factory.mktemp("service") / "data") as running:
        yield running


def test_the_list_shows_all_states_of_a_search(
    quiet: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    desk.submit(5, name="before")
    page = quiet(desk.url).go("#/jobs")
    expect(page.locator("tbody tr")).not_to_have_count(0)
    job = desk.submit(700, name="watched")
    badge = f"tr[data-job='{job}'] .state"
    expect(page.locator(badge)).to_be_visible()
    page.evaluate(RECORD_STATES, badge)
    expect(page.locator(badge)).to_have_text("succeeded", timeout=60_000)
    order = ["queued", "running", "succeeded"]
    noted = page.evaluate("noted")
    assert noted == [word for word in order if word in noted]
    assert "running" in noted
    page.get_by_role("link", name="watched").click()
    expect(page.locator(".status .progress-text")).to_have_text("700 / 700")


def test_a_running_search_is_cancelled_from_the_page(
    quiet: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    job = desk.submit(1_000_000)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("running")
    expect(page.locator(".convergence figure.chart").first).to_be_visible(timeout=60_000)
    expect(page.locator(".convergence figure.chart .position").first).not_to_have_text("generation 0")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".title .state")).to_have_text("cancelled", timeout=60_000)
    assert desk.job(job)["state"] == "cancelled"
    reached = int(desk.job(job)["progress"]["generation"])
    shown = page.locator(".convergence figure.chart .position").first.text_content().split()[-1]
    assert 0 < int(shown) <= reached
