"""Page of a running search: its phase in words, the front with equations, and a stop that keeps models."""

from collections.abc import Callable
from typing import Any

import pytest

from support.canvas import get_drawn
from support.played import advance, stored
from support.processes import eventually
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken


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
