"""List of jobs on the dashboard."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState, ProgressReport
from support.played import advance, stored
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

pytestmark = pytest.mark.ci

HOSTILE = "<script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">"


def row(page: Any, job: str) -> Any:
    return page.locator(f"tr[data-job='{job}']")


def test_a_new_job_appears_and_changes_its_state(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    page = quiet(desk.url).go()
    job = desk.submit(500, name="tank, level 3")
    state, bar = row(page, job).locator(".state"), row(page, job).locator("progress")
    expect(state).to_have_text("queued")
    expect(row(page, job)).to_contain_text("waiting")
    with stored(desk) as store:
        lease = taken(store, job)
        advance(store, lease, 0, 125)
        expect(state).to_have_text("running")
        expect(row(page, job)).to_contain_text("125 / 500")
        assert bar.evaluate("bar => bar.value") == pytest.approx(0.25)
        best = desk.job(job)["progress"]["best_error"]
        expect(row(page, job)).to_contain_text(f"best error {best:#.3g}")
        store.leases.finish(lease, JobOutcome(JobState.FAILED, problem={"title": "t", "detail": "d"}))
    expect(state).to_have_text("failed")
    expect(page.get_by_role("status")).to_have_text("\u2068tank, level 3\u2069: failed")


def test_a_name_cannot_reverse_the_text_around_it(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    """A right-to-left override would turn "report\u202efdp.exe" into "reportexe.pdf" and all that follows."""
    job = desk.submit(500, name="report\u202efdp")
    link = row(quiet(desk.url).go(), job).locator("th a")
    expect(link.locator("bdi")).to_have_text("report\u202efdp")
    assert link.locator("bdi").evaluate("node => getComputedStyle(node).unicodeBidi") == "isolate"
    desk.ask("POST", f"/v1/jobs/{job}/cancel")


def test_a_row_shows_that_its_job_waits_for_capacity_and_why_it_failed(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    waits = "waiting for capacity: 0 of 2 island actors are ready, the others need a CPU each"
    reason = "the record has a gap of 3 s after sample 400: give --set gaps=split"
    job = desk.submit(500)
    page = quiet(desk.url).go()
    with stored(desk) as store:
        lease = taken(store, job)
        store.leases.report(lease, ProgressReport({"phase": "waiting for capacity", "note": waits}))
        expect(row(page, job).locator(".progress-text")).to_have_text(waits)
        problem = {"title": "The job failed", "detail": reason}
        store.leases.finish(lease, JobOutcome(JobState.FAILED, problem=problem))
    expect(row(page, job).locator(".progress-text")).to_have_text(reason)
    assert row(page, job).locator(".progress-text").get_attribute("title") == reason
    page = quiet(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".failure")).to_contain_text(reason)
    assert page.get_by_text(reason).count() == 1


def test_markup_in_a_job_name_is_shown_as_text(quiet: Callable[..., Screen], desk: ServiceClient) -> None:
    job = desk.submit(500, name=HOSTILE)
    page = quiet(desk.url).go()
    link = row(page, job).locator("th a")
    assert link.text_content() == HOSTILE
    link.click()
    page.get_by_role("heading", level=1, name=HOSTILE, exact=True).wait_for()
    page.get_by_role("heading", name="Data set").wait_for()
    assert page.title() == f"{HOSTILE} · islands"
    assert page.locator("main script, main img").count() == 0


def test_a_hidden_page_sends_no_requests(quiet: Callable[..., Screen], desk: ServiceClient) -> None:
    desk.submit(500)
    screen = quiet(desk.url)
    asked: list[str] = []
    screen.page.on("request", lambda request: asked.append(request.url))
    screen.page.clock.install()
    page = screen.go()
    page.locator("tbody tr").first.wait_for()

    def looked_at(hidden: bool) -> int:
        """Ask for the list for half a minute; return how often it was."""
        page.evaluate(
            "hidden => { Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });"
            "document.dispatchEvent(new Event('visibilitychange')) }",
            hidden,
        )
        before = len(asked)
        for _ in range(10):
            page.clock.run_for(3000)
            page.wait_for_timeout(50)
        return len(asked) - before

    assert looked_at(hidden=False) >= 5
    assert looked_at(hidden=True) <= 1
    assert looked_at(hidden=False) >= 5


def test_a_rejected_request_shows_its_problem(
    screens: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    desk.submit(500)
    page = screens(desk.url).go("#/jobs?cursor=garbage")
    banner = page.locator(".banner")
    expect(banner).to_contain_text("'garbage' is not a cursor: send `next` of the previous page unchanged")
    expect(banner.locator("code")).to_have_text(pattern(r"[0-9a-f]{16}"))
    page.get_by_role("link", name="all", exact=True).click()
    expect(page.locator("tbody tr").first).to_be_visible()
    expect(banner).to_have_count(0)


def pattern(text: str) -> Any:

    return re.compile(text)
