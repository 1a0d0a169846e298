"""Accessibility: screen sizes, colour schemes, contrast, keyboard and screen readers."""

from collections.abc import Callable
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState
from support.markup_rules import find_markup_defects
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


#: Markup that breaks one rule each, whose name the message begins with.
BROKEN = {
    "duplicate-id": '<i id="a">1</i><i id="a">2</i>',
    "aria-valid-attr-value": '<button aria-pressed="yes">Move</button>',
    "aria-valid-attr:": '<p aria-labeled="x">text</p>',
    "aria-roles": '<p role="plot">text</p>',
    "aria-required-attr": '<p role="slider" aria-label="Row" tabindex="0">text</p>',
    "a role without a name": '<svg role="img" aria-hidden="true" width="9" height="9"></svg>',
    "label:": "<select><option>one</option></select>",
    "link-name": '<a href="#x"><img alt="" src=""></a>',
    "label-content-name-mismatch": '<button aria-label="Close">Delete</button>',
    "tabindex": '<p tabindex="3">text</p>',
    "aria-hidden-focus": '<p aria-hidden="true"><button>Move</button></p>',
    "nested-interactive": '<div role="img" aria-label="Map"><button>Move</button></div>',
    "scrollable-region-focusable": '<p style="overflow: auto; height: 9px">one<br>two<br>three</p>',
    "list:": "<ul><p>text</p></ul>",
    "empty-table-header": '<table><tr><th scope="col"></th></tr></table>',
    "scope-attr-valid": "<table><tr><th>Row</th></tr></table>",
    "td-has-header": "<table><tbody><tr><td>1</td></tr></tbody></table>",
    "svg-img-alt": '<svg width="9" height="9"></svg>',
    "canvas": '<canvas width="9" height="9"></canvas>',
    "target-size": '<button style="all: unset">i</button><button style="all: unset">j</button>',
}


@pytest.mark.ci
def test_each_rule_of_the_markup_finds_what_breaks_it(
    screens: Callable[..., Screen], desk: ServiceClient
) -> None:
    page = screens(desk.url).page
    frame = "<html lang=en><title>x</title><main><h1>Rules</h1>{}</main></html>"
    page.set_content(frame.format("<p>text</p>"))
    assert find_markup_defects(page) == []
    for rule, markup in BROKEN.items():
        page.set_content(frame.format(markup))
        defects = find_markup_defects(page)
        assert any(defect.startswith(rule) for defect in defects), (rule, defects)


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
