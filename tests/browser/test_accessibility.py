"""Accessibility: screen sizes, colour schemes, contrast, keyboard and screen readers."""

from collections.abc import Callable
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState
from support.played import advance, stored
from support.reading import unreadable
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

WIDE, NARROW = (1280, 800), (360, 800)


@pytest.fixture(scope="module")
def places(desk: ServiceClient) -> dict[str, str]:
    """Addresses of all views without a result."""
    problem = {"title": "The job failed", "detail": "data.csv, line 8, column y_um is empty: " + "x" * 200}
    failed = desk.submit(500, name="a-name-without-a-space-" * 8, tags=["rig 2", "t" * 40])
    cancelled = desk.submit(500, name="cancelled")
    running = desk.submit(500, name="running", settings={"islands": 8})
    with stored(desk) as store:
        lease = taken(store, failed)
        advance(store, lease, 0, 100)
        store.leases.finish(lease, JobOutcome(JobState.FAILED, problem=problem))
        store.leases.finish(taken(store, cancelled), JobOutcome(JobState.CANCELLED))
        advance(store, taken(store, running), 0, 212, islands=8)
    desk.submit(500, name="queued")
    return {"list": "#/jobs", "empty": "#/jobs?state=succeeded", "failed": failed, "running": running}


def opened(screen: Screen, place: str) -> Any:
    page = screen.go(place if place.startswith("#") else f"#/jobs/{place}")
    ready = "tbody tr, .empty" if place.startswith("#") else "figure.chart, .failure"
    page.locator(ready).first.wait_for()
    if not place.startswith("#"):
        page.locator("table code", has_text="y_um").wait_for()
    return page


@pytest.mark.parametrize("name", ["list", "empty", "failed", "running"])
@pytest.mark.parametrize(
    ("scheme", "width", "height"),
    [
        pytest.param("light", *WIDE, marks=pytest.mark.nightly),
        pytest.param("dark", *NARROW, marks=pytest.mark.ci),
    ],
)
def test_every_page_fits_and_has_sufficient_contrast(
    quiet: Callable[..., Screen],
    desk: ServiceClient,
    places: dict[str, str],
    name: str,
    scheme: str,
    width: int,
    height: int,
) -> None:
    page = opened(quiet(desk.url, width, height, color_scheme=scheme), places[name])
    assert unreadable(page) == []


@pytest.mark.ci
def test_a_state_has_a_symbol_in_addition_to_its_colour(
    quiet: Callable[..., Screen], desk: ServiceClient, places: dict[str, str]
) -> None:
    page = opened(quiet(desk.url), places["list"])
    badges = page.locator("tbody .state").evaluate_all(
        "all => all.map((one) => [one.textContent, getComputedStyle(one, '::before').content])"
    )
    assert {word for word, _ in badges} == {"queued", "running", "cancelled", "failed"}
    assert len({sign for _, sign in badges}) == 4


@pytest.mark.ci
def test_all_controls_are_reachable_by_keyboard(
    quiet: Callable[..., Screen], desk: ServiceClient, places: dict[str, str]
) -> None:
    page = opened(quiet(desk.url), places["running"])
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
    reached = set()
    for _ in range(24):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate("document.activeElement.ariaLabel ?? document.activeElement.textContent.trim()")
        )
    assert {
        "islands",
        "← Jobs",
        "Cancel",
        "Error of each island",
        "Front of size against error",
        "Stop and keep the best",
    } <= reached
    assert "Columns of the data set" in reached
