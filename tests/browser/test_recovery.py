"""Dashboard during and after an outage of the service: it reconnects and keeps its state."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from support.canvas import count_segments, get_lines
from support.played import advance, squared_error, stored
from support.processes import eventually, kill
from support.screen import Screen
from support.service_processes import Service, serving
from support.stores import taken


@pytest.fixture(scope="module")
def desk(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service in processes, which a test can kill."""
    with serving(tmp_path_factory.mktemp("desk") / "data", "--coordinators", 0) as running:
        yield running


@contextmanager
def outage(service: Service) -> Iterator[None]:
    """Kill the web server; the supervisor restarts it only after the block."""
    os.kill(service.process.pid, signal.SIGSTOP)
    try:
        # The child of a stopped parent remains a zombie, which accepts no connections.
        kill(service.one("api"))
        eventually(lambda: not service.pids("api"))
        yield
    finally:
        os.kill(service.process.pid, signal.SIGCONT)
    service.ready()


@pytest.mark.ci
def test_the_list_shows_an_outage_and_recovers(
    screens: Callable[..., Screen], desk: Service, expect: Any
) -> None:
    job = desk.submit(500, name="before")
    page = screens(desk.url).go()
    tried: list[str] = []
    page.on("requestfailed", lambda request: tried.append(request.url))
    expect(page.locator(f"tr[data-job='{job}']")).to_be_visible()
    with outage(desk):
        expect(page.locator(".banner.unavailable")).to_contain_text("The service does not answer.")
        page.wait_for_timeout(4000)
        # With increasing intervals: 0.5, 1, 2 and 4 s.
        assert 2 <= len(tried) <= 5
        # The last known data remain visible.
        assert page.locator(f"tr[data-job='{job}']").is_visible()
    later = desk.submit(500, name="after")
    expect(page.locator(f"tr[data-job='{later}']")).to_be_visible()
    expect(page.locator(".banner")).to_have_count(0)
    expect(page.get_by_role("status")).to_have_text("The service is available again.")


@pytest.mark.nightly
def test_the_page_of_a_job_continues_after_a_broken_stream(
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
        expect(page.locator(".status .progress-text")).to_have_text("50 / 500")
        advance(store, lease, 51, 60)
        expect(page.locator(".status .progress-text")).to_have_text("60 / 500")
        seen = desk.job(job)["version"]
        with outage(desk):
            expect(page.locator(".banner.unavailable")).to_be_visible()
            advance(store, lease, 61, 99)
            advance(store, lease, 100, 140)
        expect(page.locator(".status .progress-text")).to_have_text("140 / 500")
        expect(page.locator(".banner")).to_have_count(0)
        advance(store, lease, 141, 150)
        expect(page.locator(".convergence figure.chart .position").first).to_have_text("generation 150")
    assert int(resumed[0]) < seen
    assert set(resumed[1:]) == {str(seen)}
    chart = page.locator(".convergence figure.chart").first
    eventually(lambda: [count_segments(parts) for parts in get_lines(chart).values()] == [150, 150])
    shown = page.locator(".convergence figure.chart data").first.get_attribute("value")
    assert float(shown) == pytest.approx(squared_error(150, 0) ** 0.5)
