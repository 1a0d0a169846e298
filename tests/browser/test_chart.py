"""Charts, scales and number formats, tested in the browser."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from support.canvas import DRAWN, count_segments, get_lines
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci

CHART = """async ({ options, series, events }) => {
  const { makeLineChart } = await import("/dashboard/components/chart.js");
  const labels = { title: "Errors", x: { label: "generation" }, y: { label: "RMS error" } };
  window.leave?.abort();
  window.leave = new AbortController();
  window.chart = makeLineChart({ ...labels, ...options }, leave.signal);
  document.getElementById("main").replaceChildren(chart.node);
  chart.draw(series, events);
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""

LOG = {"y": {"label": "RMS error", "log": True}}


@pytest.fixture(scope="module")
def page(chromium: Any, desk: ServiceClient) -> Iterator[Any]:
    """One page for all tests: each chart replaces the previous one."""
    screen = Screen(chromium.new_page(viewport={"width": 1280, "height": 800}), desk.url)
    screen.go().get_by_role("heading", name="Jobs", exact=True).wait_for()
    yield screen.page
    screen.page.close()
    assert screen.complaints == []


def call(page: Any, module: str, name: str, *arguments: Any) -> Any:
    script = "async ([module, name, args]) => (await import(`/dashboard/${module}`))[name](...args)"
    return page.evaluate(script, [module, name, arguments])


def make_series(name: str, points: Sequence[Sequence[float | None]], **more: Any) -> dict[str, Any]:
    x, y = zip(*points, strict=True) if points else ([], [])
    return {"name": name, "x": x, "y": y, **more}


def draw(
    page: Any, series: list[dict[str, Any]], events: Sequence[dict[str, Any]] = (), **options: Any
) -> Any:
    page.evaluate(CHART, {"options": options, "series": series, "events": events})
    return page.locator("figure.chart")


def heights(chart: Any, name: str) -> list[float]:
    """Return the ordinates of a line."""
    return [y for part in get_lines(chart)[name] for _, y in part]


@pytest.mark.parametrize(
    ("value", "half", "written"),
    [
        (99.8312, 0.0617, "99.831 ± 0.062"),
        (-0.99988, 3.6e-4, "−0.99988 ± 0.00036"),
        (1234.5, 250.0, "1235 ± 250"),
        (2.5e-9, 3e-11, "2.500×10⁻⁹ ± 3.0×10⁻¹¹"),
        (1.0, 0.0, "1.00"),
    ],
)
def test_an_interval_has_two_digits_and_its_value_as_many_decimals(
    page: Any, value: float, half: float, written: str
) -> None:
    assert call(page, "lib/numbers.js", "formatInterval", value, half) == written


def test_every_series_has_its_line_and_its_last_value_in_the_legend(page: Any) -> None:
    series = [make_series(f"island {i}", [[0, 1.0 * i], [5, 0.5 * i]]) for i in (1, 2, 3)]
    chart = draw(page, series, **LOG)
    assert [count_segments(parts) for parts in get_lines(chart).values()] == [1, 1, 1]
    assert chart.locator("canvas").evaluate(DRAWN) > 100
    # On a logarithmic axis, lines through multiples of the same values are parallel.
    drops = [heights(chart, f"island {i}")[1] - heights(chart, f"island {i}")[0] for i in (1, 2, 3)]
    assert drops == pytest.approx([drops[0]] * 3)
    assert chart.locator(".legend li").all_text_contents() == [
        "island 1 0.500",
        "island 2 1.00",
        "island 3 1.50",
    ]
    assert chart.locator(".legend data").last.get_attribute("value") == "1.5"


def test_arrow_keys_move_the_pointer_and_announce_the_values(page: Any) -> None:
    series = [make_series("a", [[at, 1.0 / (at + 1)] for at in range(0, 50, 5)])]
    plot = draw(page, series, **LOG).get_by_role("slider", name="Errors")
    plot.focus()
    for key, said in {
        "Home": "generation 0: a 1.00",
        "ArrowRight": "generation 5: a 0.167",
        "End": "generation 45: a 0.0217",
        "ArrowLeft": "generation 40: a 0.0244",
    }.items():
        page.keyboard.press(key)
        assert plot.get_attribute("aria-valuetext") == said
    assert (plot.get_attribute("aria-valuemin"), plot.get_attribute("aria-valuemax")) == ("0", "45")


def test_the_name_of_a_series_is_not_interpreted_as_markup(page: Any) -> None:
    name = "<img src=x onerror=alert(1)>"
    chart = draw(page, [make_series(name, [[0, 1.0], [1, 2.0]])])
    assert chart.locator(".legend li").text_content() == f"{name} 2.00"
    assert page.locator("img[src=x]").count() == 0


@pytest.mark.parametrize(
    ("low", "high"), [(0, 1), (-3.2, 7.7), (0, 500), (1e-9, 3e-9), (2, 2.0001), (0, 1e6)]
)
def test_round_ticks_are_within_the_axis_and_of_suitable_number(page: Any, low: float, high: float) -> None:
    ticks = call(page, "lib/scale.js", "roundTicks", low, high, 6)
    assert 2 <= len(ticks) <= 7
    assert all(low - 1e-9 * (high - low) <= tick <= high + 1e-9 * (high - low) for tick in ticks)
    assert ticks == sorted(set(ticks))


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.14920162668214762, "0.149"),
        (12060, "12060"),
        (-1.5, "−1.50"),
        (0, "0"),
        (5.7e-5, "5.70×10⁻⁵"),
        (2.5e9, "2.50×10⁹"),
        (None, "–"),
    ],
)
def test_numbers_are_formatted_with_significant_digits(page: Any, value: float | None, written: str) -> None:
    assert call(page, "lib/numbers.js", "formatNumber", value) == written


@pytest.mark.parametrize(
    ("seconds", "written"),
    [
        (0.27, "0.3 s"),
        (59.6, "1 min"),
        (200, "3 min 20 s"),
        (3600, "1 h"),
        (7500, "2 h 5 min"),
        (90_000, "1 d 1 h"),
    ],
)
def test_durations_are_formatted_with_their_largest_units(page: Any, seconds: float, written: str) -> None:
    assert call(page, "lib/numbers.js", "formatDuration", seconds) == written


def list_island_errors(page: Any, points: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the series of errors that arrive point by point."""
    script = """async (points) => {
      const { makeIslandErrors } = await import("/dashboard/components/convergence.js");
      const errors = makeIslandErrors();
      for (const point of points) errors.add([point]);
      return errors.list();
    }"""
    series: list[dict[str, Any]] = page.evaluate(script, points)
    return series


def test_the_errors_of_a_long_search_are_those_of_spread_generations(page: Any) -> None:
    points = [{"generation": g, "islands": [1.0 + g, 4.0 + g]} for g in range(5000)]
    series = list_island_errors(page, points)
    assert [each["name"] for each in series] == ["island 1", "island 2"]
    for each, first in zip(series, (1.0, 4.0), strict=True):
        assert 300 <= len(each["x"]) <= 600
        assert (each["x"][0], each["x"][-1]) == (0, 4999)
        assert each["y"] == pytest.approx([math.sqrt(first + g) for g in each["x"]])
