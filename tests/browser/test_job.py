"""Page of an identification job; the test acts as the coordinator."""

import re
from collections.abc import Callable, Iterator
from math import sqrt
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState, ProgressReport
from support.canvas import count_segments, get_lines
from support.played import advance, squared_error, stored
from support.processes import eventually
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

PROBLEM = {"type": "invalid-record", "title": "The job failed", "detail": "row 7 <b>column y</b> is empty"}


def legend(page: Any) -> list[float]:
    """Return the values of the chart of the islands with full precision."""
    chart = page.locator(".convergence figure.chart").first
    return [float(each) for each in chart.locator("data").evaluate_all("all => all.map((one) => one.value)")]


def island_errors(generation: int, islands: int = 2) -> list[float]:
    return [sqrt(squared_error(generation, island)) for island in range(islands)]


@pytest.mark.ci
def test_the_convergence_chart_grows_with_the_events(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500, name="piezo")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("queued")
    with stored(desk) as store:
        lease = taken(store, job)
        expect(page.locator(".title .state")).to_have_text("running")
        for first, last in ((0, 40), (41, 90), (91, 200)):
            advance(store, lease, first, last)
            expect(page.locator(".status .progress-text")).to_have_text(f"{last} / 500")
            expect(page.locator(".convergence figure.chart .position").first).to_have_text(
                f"generation {last}"
            )
            assert legend(page) == pytest.approx(island_errors(last))
    # It is counted down.
    expect(page.get_by_text(re.compile(r"about [56]\.\d s"))).to_be_visible()
    chart = page.locator(".convergence figure.chart").first
    # One point for each reported generation.
    eventually(lambda: [count_segments(parts) for parts in get_lines(chart).values()] == [200, 200])


@pytest.mark.ci
def test_bar_and_time_left_of_a_search_move_from_its_first_phase_on(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500, name="piezo")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    bar, text = page.locator(".status progress"), page.locator(".status .progress-text")
    with stored(desk) as store:
        lease = taken(store, job)
        expect(page.locator(".title .state")).to_have_text("running")
        for phase, sentence, fraction, left in (
            ("preset auto: trial of smooth", "Choice of the preset: trial of smooth.", 0.05, None),
            ("search", "Evolution of equations.", 0.4, 6.0),
        ):
            progress = {"phase": phase, "fraction": fraction, "seconds_left": left}
            store.leases.report(lease, ProgressReport(progress))
            expect(page.locator(".doing")).to_have_text(sentence)
            assert bar.evaluate("bar => bar.value") == pytest.approx(fraction)
        facts = page.locator(".status .facts")
        expect(facts).to_contain_text(re.compile(r"about [345]\.\d s"))
        # Without a further report the estimate is not kept.
        expect(facts).to_contain_text("longer than expected")
        advance(store, lease, 0, 250)
        expect(text).to_have_text("250 / 500")


@pytest.mark.ci
def test_a_failed_job_shows_its_problem(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    with stored(desk) as store:
        store.leases.finish(taken(store, job), JobOutcome(JobState.FAILED, problem=PROBLEM))
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".failure")).to_contain_text("The job failed" + PROBLEM["detail"])
    assert page.locator(".failure b").count() == 0
    names = [each.text_content() for each in page.locator(".actions button:visible").all()]
    assert names == ["Delete"]


@pytest.mark.ci
def test_a_queued_job_is_cancelled_resumed_and_deleted_if_confirmed(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500, name="piezo")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    state, dialog = page.locator(".title .state"), page.get_by_role("dialog")
    page.get_by_role("button", name="Cancel").focus()
    page.keyboard.press("Enter")
    expect(state).to_have_text("cancelled")
    # The button is hidden, but the keyboard focus does not return to the start of the page.
    expect(page.get_by_role("heading", level=1)).to_be_focused()
    assert desk.job(job)["state"] == "cancelled"
    expect(page.get_by_role("status")).to_have_text("\u2068piezo\u2069: cancelled")
    page.get_by_role("button", name="Resume").click()
    expect(state).to_have_text("queued")
    page.get_by_role("button", name="Cancel").click()
    page.get_by_role("button", name="Delete").click()
    expect(dialog).to_contain_text("\u2068piezo\u2069 is deleted with its models")
    page.keyboard.press("Enter")
    expect(dialog).to_have_count(0)
    page.get_by_role("button", name="Delete").click()
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    assert desk.job(job)["state"] == "cancelled"
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("button", name="Delete it").click()
    expect(page.get_by_role("heading", name="Jobs", exact=True)).to_be_visible()
    assert desk.ask("GET", f"/v1/jobs/{job}").status_code == 404


STYLED = (
    '<math xmlns="http://www.w3.org/1998/Math/MathML" style="top: 0"><mi style="color: red">y</mi></math>'
)

EQUATIONS = {
    STYLED: "y",
    "<math><mi>y</mi></math>": "y",
    '<math xmlns="http://www.w3.org/1998/Math/MathML"><mrow><mi>a</mi><mo>+</mo></mrow></math>': "a+",
    "<math><mtext>&lt;b&gt;</mtext><!-- remark --></math>": "<b>",
    "<math><mi>y</mi><script>document.title='taken'</script></math>": None,
    '<math><mi href="javascript:alert(1)" onclick="alert(1)" style="color:red">y</mi></math>': "y",
    "<math><annotation-xml encoding='text/html'><img src='x'/></annotation-xml></math>": None,
    '<html xmlns="http://www.w3.org/1999/xhtml"><script>1</script></html>': None,
    "<math><mi>y</math>": None,
    "": None,
}


@pytest.fixture(scope="module")
def blank(chromium: Any, desk: ServiceClient) -> Iterator[Screen]:
    """One page for all equations, which it does not show."""
    screen = Screen(chromium.new_page(), desk.url)
    screen.go()
    yield screen
    screen.page.close()
    assert screen.foreign == []


@pytest.mark.ci
@pytest.mark.parametrize("source", EQUATIONS)
def test_an_equation_contains_only_mathematics(blank: Screen, source: str) -> None:
    before = len(blank.complaints)
    found = blank.page.evaluate(
        """async (source) => {
          const { parseMath } = await import("/dashboard/components/equation.js");
          try {
            const [math, ...others] = parseMath(source);
            const all = [math, ...math.querySelectorAll("*"), ...others];
            const names = all.flatMap((node) => [...node.attributes].map((each) => each.name));
            return { text: math.textContent, names, own: all.every((node) => node instanceof MathMLElement) };
          } catch (error) {
            return null;
          }
        }""",
        source,
    )
    expected = EQUATIONS[source]
    if expected is None:
        assert found is None
    else:
        assert found == {"text": expected, "names": [], "own": True}
        assert blank.complaints[before:] == []
