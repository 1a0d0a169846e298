"""Page of an identification job; the test acts as the coordinator."""

import re
from collections.abc import Callable, Iterator
from math import sqrt
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState, ProgressReport
from support.canvas import count_segments, get_faint_lines, get_lines
from support.played import advance, squared_error, stored
from support.processes import eventually
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import LONG, taken

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
def test_warnings_about_the_data_are_shown_during_the_search(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500, name="piezo")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    warning = "validation extrapolates: u is -3 to 3 V in the validation data"
    expect(page.get_by_text("Warning")).to_have_count(0)
    with stored(desk) as store:
        lease = taken(store, job)
        store.leases.report(lease, ProgressReport({"phase": "search", "warnings": [warning]}))
        expect(page.get_by_text(warning)).to_be_visible()


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
def test_a_job_shows_its_run_time_and_the_limit(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("queued")
    run_time = page.locator("dt", has_text="Run time").locator("xpath=following-sibling::dd[1]")
    expect(run_time).to_have_count(0)
    with stored(desk) as store:
        lease = taken(store, job)
        expect(run_time).to_have_text(re.compile(r"^[\d.]+ s \(limit 1 h\)$"))
        shown = run_time.text_content()
        advance(store, lease, 0, 40)
        # The time runs on with every report.
        eventually(lambda: run_time.text_content() != shown)
        store.leases.renew(lease, LONG, ran=7500.0)
        store.leases.finish(lease, JobOutcome(JobState.FAILED, problem=PROBLEM))
    expect(page.locator(".title .state")).to_have_text("failed")
    expect(run_time).to_have_text("2 h 5 min (limit 1 h)")


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


@pytest.mark.ci
def test_a_running_job_is_cancelling_until_its_coordinator_stops(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    with stored(desk) as store:
        lease = taken(store, job)
        advance(store, lease, 0, 10)
        page.get_by_role("button", name="Cancel").click()
        expect(page.locator(".title .state")).to_have_text("cancelling")
        expect(page.get_by_role("button", name="Cancel")).to_be_hidden()
        store.leases.finish(lease, JobOutcome(JobState.CANCELLED))
    expect(page.locator(".title .state")).to_have_text("cancelled")
    expect(page.locator(".status .progress-text")).to_have_text("10 / 500")


@pytest.mark.ci
@pytest.mark.parametrize("state", [JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED])
def test_an_ended_job_shows_no_note_and_no_phase_of_its_attempts(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any, state: JobState
) -> None:
    reason, note = "the disk was full", "waiting for capacity"
    job = desk.submit(500, name="piezo")
    screen = quiet(desk.url)
    page = screen.go(f"#/jobs/{job}")
    body = page.locator("body")
    with stored(desk) as store:
        store.leases.postpone(taken(store, job), reason, 0.0)
        expect(body).to_contain_text(reason)
        lease = taken(store, job)
        store.leases.report(lease, ProgressReport({"phase": "waiting", "note": note}))
        expect(body).to_contain_text(note)
        store.leases.finish(lease, JobOutcome(state, problem=PROBLEM if state == JobState.FAILED else None))
    expect(page.locator(".title .state")).to_have_text(state)
    for text in (reason, note):
        expect(body).not_to_contain_text(text)
    screen.go("#/")
    expect(body).to_contain_text("piezo")
    for text in (reason, note):
        expect(body).not_to_contain_text(text)


@pytest.mark.nightly
def test_a_job_resumed_by_another_client_is_updated(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    desk.ask("POST", f"/v1/jobs/{job}/cancel")
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("cancelled")
    desk.ask("POST", f"/v1/jobs/{job}/resume")
    expect(page.locator(".title .state")).to_have_text("queued")
    with stored(desk) as store:
        advance(store, taken(store, job), 0, 5)
    expect(page.locator(".status .progress-text")).to_have_text("5 / 500")


@pytest.mark.nightly
def test_a_late_response_does_not_restore_an_old_state(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    held: list[Any] = []
    page = quiet(desk.url).go(f"#/jobs/{job}")
    page.route("**/cancel", lambda route: held.append((route, route.fetch())))
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".title .state")).to_have_text("cancelled")
    assert desk.ask("POST", f"/v1/jobs/{job}/resume").status_code == 202
    expect(page.locator(".title .state")).to_have_text("queued")
    (route, answer) = held[0]
    with page.expect_response("**/cancel"):
        route.fulfill(response=answer)
    page.wait_for_timeout(300)
    assert page.locator(".title .state").text_content() == "queued"


@pytest.mark.ci
def test_a_reload_keeps_the_scroll_position(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    with stored(desk) as store:
        advance(store, taken(store, job), 0, 30)
    page = quiet(desk.url, height=500).go(f"#/jobs/{job}")
    expect(page.locator(".convergence figure.chart").first).to_be_visible()
    page.locator("table code", has_text="y_um").wait_for()
    page.evaluate("scrollTo(0, 320)")
    page.reload()
    expect(page.locator(".convergence figure.chart").first).to_be_visible()
    # The security policy forbids evaluating text, so `wait_for_function` of playwright does not work.
    eventually(lambda: page.evaluate("scrollY") == 320)
    assert page.url.endswith(f"#/jobs/{job}")


@pytest.mark.ci
def test_every_island_has_a_line_for_any_number_of_islands(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500, settings={"islands": 20})
    with stored(desk) as store:
        advance(store, taken(store, job), 0, 30, islands=20)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    chart = page.locator(".convergence figure.chart").first
    expect(chart.locator(".legend li")).to_have_count(2)
    eventually(lambda: [len(line) for line in get_faint_lines(chart)] == [31] * 20)
    # Island 1 has the least errors, and pixels are counted from the top.
    ends = [line[-1][1] for line in get_faint_lines(chart)]
    assert ends == sorted(ends, reverse=True)
    assert legend(page) == pytest.approx([island_errors(30, 20)[0], island_errors(30, 20)[19]])


@pytest.mark.ci
def test_an_unknown_job_shows_a_message(
    screens: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    page = screens(desk.url).go("#/jobs/nope")
    expect(page.get_by_role("heading", name="There is no such job")).to_be_visible()
    expect(page.locator("main")).to_contain_text("there is no job 'nope'")
    page.get_by_role("link", name="Show all jobs").click()
    expect(page.get_by_role("heading", name="Jobs", exact=True)).to_be_visible()


@pytest.mark.ci
def test_a_job_deleted_by_another_client_shows_a_message(
    screens: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    page = screens(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("queued")
    desk.ask("POST", f"/v1/jobs/{job}/cancel")
    assert desk.ask("DELETE", f"/v1/jobs/{job}").status_code == 204
    expect(page.get_by_role("heading", name="There is no such job")).to_be_visible(timeout=10_000)


@pytest.mark.ci
def test_the_page_shows_the_settings_and_the_data_set_of_a_job(
    quiet: Callable[..., Screen], desk: ServiceClient
) -> None:
    page = quiet(desk.url).go(f"#/jobs/{desk.submit(321, rows='0:3500')}")
    page.locator("table code", has_text="y_um").wait_for()
    shown = dict(
        zip(
            page.locator(".about dt").all_text_contents(),
            page.locator(".about dd").all_text_contents(),
            strict=True,
        )
    )
    wanted = {"Inputs": "u_V", "Output": "y_um", "Seed": "2", "Rows": "0:3500", "generations": "321"}
    wanted |= {"Samples": "4\u202f000", "Sampling time": "0.01 s", "File": "data.csv"}
    assert wanted.items() <= shown.items()
    roles = page.locator(".about tbody tr td:nth-child(3)").all_text_contents()
    assert roles == ["time", "input", "output"]
    page.locator(".about").get_by_role("link", name="data.csv").click()
    page.get_by_role("heading", name="Signals").wait_for()


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
