"""The page while the service is away, and after: it comes back by itself, where it was."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from support.played import advance, squared_error, stored
from support.processes import eventually, kill
from support.screen import Screen
from support.service_processes import Service
from support.stores import taken


@contextmanager
def away(service: Service) -> Iterator[None]:
    """Kill the doors, and keep the supervisor from starting them again before the block ends."""
    os.kill(service.process.pid, signal.SIGSTOP)
    try:
        # A child of a stopped parent stays a zombie, which nobody can connect to.
        kill(service.one("api"))
        eventually(lambda: not service.pids("api"))
        yield
    finally:
        os.kill(service.process.pid, signal.SIGCONT)
    service.ready()


@pytest.mark.ci
def test_the_list_says_that_the_service_is_away_and_recovers(
    screens: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    job = desk.submit(500, name="before")
    page = screens(desk.url).go()
    tried: list[str] = []
    page.on("requestfailed", lambda request: tried.append(request.url))
    expect(page.locator(f"tr[data-job='{job}']")).to_be_visible()
    with away(desk):
        expect(page.locator(".banner.away")).to_contain_text("The service does not answer.")
        page.wait_for_timeout(4000)
        # Less and less often: 0.5, 1, 2 and 4 s apart.
        assert 2 <= len(tried) <= 5
        # What was known stays on the screen.
        assert page.locator(f"tr[data-job='{job}']").is_visible()
    later = desk.submit(500, name="after")
    expect(page.locator(f"tr[data-job='{later}']")).to_be_visible()
    expect(page.locator(".banner")).to_have_count(0)
    expect(page.get_by_role("status")).to_have_text("The service is back.")


@pytest.mark.ci
def test_a_job_goes_on_where_its_stream_was_cut(
    screens: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    job = desk.submit(500)
    with stored(desk) as store:
        lease = taken(store, job)
        advance(store, lease, 0, 50)
        screen = screens(desk.url)
        resumed: list[str] = []
        screen.page.on(
            "request",
            lambda request: (
                request.url.endswith("/events") and resumed.append(request.headers["last-event-id"])
            ),
        )
        page = screen.go(f"#/jobs/{job}")
        expect(page.locator(".stand .words")).to_have_text("50 / 500")
        advance(store, lease, 51, 60)
        expect(page.locator(".stand .words")).to_have_text("60 / 500")
        seen = desk.job(job)["version"]
        with away(desk):
            expect(page.locator(".banner.away")).to_be_visible()
            advance(store, lease, 61, 99)
            advance(store, lease, 100, 140)
        expect(page.locator(".stand .words")).to_have_text("140 / 500")
        expect(page.locator(".banner")).to_have_count(0)
        advance(store, lease, 141, 150)
        expect(page.locator("figure.chart .place").first).to_have_text("generation 150")
    assert int(resumed[0]) < seen
    assert set(resumed[1:]) == {str(seen)}
    line = page.locator("figure.chart").first.locator("path.line[data-name]").first
    assert line.get_attribute("d").count("L") == 150
    shown = page.locator("figure.chart data").first.get_attribute("value")
    assert float(shown) == pytest.approx(squared_error(150, 0) ** 0.5)


@pytest.mark.nightly
def test_a_killed_service_is_back_before_anybody_does_anything(
    screens: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    job = desk.submit(500)
    page = screens(desk.url).go(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("queued")
    kill(desk.one("api"))
    desk.ready()
    with stored(desk) as store:
        advance(store, taken(store, job), 0, 7)
    expect(page.locator(".stand .words")).to_have_text("7 / 500")


@pytest.mark.nightly
def test_a_page_that_is_opened_while_the_service_fails_says_so(
    screens: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    """As behind a proxy, or with a database that is away: the answer is 503, and then it is not."""
    job = desk.submit(500)
    page = screens(desk.url).page
    detail = "the database does not answer: try again in a moment"
    page.route(
        "**/v1/jobs?*",
        lambda route: route.fulfill(
            status=503, content_type="application/problem+json", json={"status": 503, "detail": detail}
        ),
    )
    page.goto(desk.url)
    expect(page.locator(".banner.away")).to_contain_text(detail)
    page.unroute("**/v1/jobs?*")
    expect(page.locator(f"tr[data-job='{job}']")).to_be_visible()
    expect(page.locator(".banner")).to_have_count(0)
