"""Page of a running search: its phase in words, the front with equations, and a stop that keeps models."""

import re
from collections.abc import Callable, Iterator
from threading import Thread
from typing import Any

import pytest

from islands_service.liveness import StopRequest
from islands_service.settings import ServiceSettings
from support.canvas import count_segments, get_drawn, get_lines
from support.coordinators import SerialCoordinator
from support.played import advance, stored
from support.processes import eventually
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken


@pytest.fixture(scope="module")
def searching(service: ServiceClient) -> Iterator[ServiceClient]:
    """The service, whose searches run in this process, without Ray."""
    stopping = StopRequest()
    settings = ServiceSettings(data_dir=service.folder)
    thread = Thread(target=SerialCoordinator(settings, "me", stopping).run)
    thread.start()
    yield service
    stopping.request()
    thread.join(30.0)


@pytest.mark.ci
def test_the_front_grows_and_its_points_show_their_equations(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = desk.submit(500)
    page = quiet(desk.url).go(f"#/jobs/{job}")
    equation, chart = page.locator(".live .equation"), page.locator(".live > figure.chart")
    with stored(desk) as store:
        lease = taken(store, job)
        expect(page.locator(".live")).to_be_hidden()
        for last in (40, 90):
            advance(store, lease, last - 1, last)
            eventually(lambda: len(get_drawn(chart)["circles"]) == 5)
            expect(equation).to_have_text(
                "y_um(k) = " + " + ".join(f"{last}*y_um(k-{n})" for n in range(1, 6))
            )
        plot = page.get_by_role("slider", name="Front of size against error")
        plot.focus()
        for key in ("Home", "ArrowRight", "Enter"):
            page.keyboard.press(key)
        expect(equation).to_have_text("y_um(k) = 90*y_um(k-1) + 90*y_um(k-2)")
        expect(page.locator(".live")).to_contain_text("Chosen point: 2 terms")
        # The chosen size stays while the search goes on.
        advance(store, lease, 91, 95)
        expect(equation).to_have_text("y_um(k) = 95*y_um(k-1) + 95*y_um(k-2)")
    ways = "Islands that received models: island 1 from 2; island 2 from 1"
    expect(page.get_by_role("img", name=ways)).to_be_visible()
    expect(page.locator(".map")).to_contain_text("Generation 95: 1 model was sent along each arrow.")


@pytest.mark.nightly
def test_stop_and_keep_the_best_ends_a_search_with_models(
    opened: Callable[..., Any], searching: ServiceClient, expect: Any
) -> None:
    job = searching.submit(1_000_000, name="endless")
    page = opened(f"#/jobs/{job}")
    expect(page.locator(".live .equation")).to_contain_text("y_um(k) = ", timeout=60_000)
    run = page.locator(".search-run")
    expect(run.locator(".legend li")).to_contain_text(["measured", "free run"])
    expect(run).to_contain_text(re.compile(r"\d+ terms?, generation [\d ]+, over the estimation data\."))
    eventually(lambda: [count_segments(parts) > 50 for parts in get_lines(run).values()] == [True, True])
    # Its equation is shown, and the search still improves it.
    terms = run.locator("p.small").inner_text().split(",")[0]
    expect(page.locator(".live-model")).to_contain_text(f": {terms}, error")
    page.get_by_role("button", name="Stop and keep the best").click()
    expect(page.get_by_role("button", name="Stop and keep the best")).to_be_hidden()
    expect(page.locator(".title .state")).to_have_text("succeeded", timeout=60_000)
    expect(page.locator(".status .facts")).to_contain_text("stopped by its owner")
    expect(page.locator("main")).to_contain_text("the owner stopped the job, which leaves out: search from")
    expect(page.locator("table.models tbody tr")).not_to_have_count(0)
    # Each point of the front opens its model, by the keyboard as well.
    models = searching.ask("GET", f"/v1/jobs/{job}/models").json()["items"]
    smallest = min(models, key=lambda model: model["size"])
    page.get_by_role("slider", name="Size against error").focus()
    for key in ("Home", "Enter"):
        page.keyboard.press(key)
    expect(page.get_by_role("heading", name=f"Model {smallest['rank']}", exact=True)).to_be_visible()
    assert page.url.endswith(f"#/jobs/{job}/models/{smallest['rank']}")
