"""Charts, scales and numbers, in the browser that draws them."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

from support.screen import Screen
from support.service_processes import Service

pytestmark = pytest.mark.ci

CHART = """async ({ options, series }) => {
  const { lineChart } = await import("/dashboard/chart.js");
  const labels = { title: "Errors", x: { label: "generation" }, y: { label: "RMS error" } };
  const chart = lineChart({ ...labels, ...options });
  document.getElementById("main").replaceChildren(chart.node);
  chart.draw(series);
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""

LOG = {"y": {"label": "RMS error", "log": True}}


@pytest.fixture(scope="module")
def page(chromium: Any, desk: Service) -> Iterator[Any]:
    """One page for all: a chart that is drawn takes the place of the one before."""
    screen = Screen(chromium.new_page(viewport={"width": 1280, "height": 800}), desk.url)
    screen.go().get_by_role("heading", name="Jobs", exact=True).wait_for()
    yield screen.page
    screen.page.close()
    assert screen.complaints == []


def call(page: Any, module: str, name: str, *arguments: Any) -> Any:
    script = "async ([module, name, args]) => (await import(`/dashboard/${module}`))[name](...args)"
    return page.evaluate(script, [module, name, arguments])


def draw(page: Any, series: list[dict[str, Any]], **options: Any) -> Any:
    page.evaluate(CHART, {"options": options, "series": series})
    return page.locator("figure.chart")


def heights(chart: Any, name: str) -> list[float]:
    """The ordinates of a line's path."""
    path = chart.locator(f"path[data-name='{name}']").get_attribute("d")
    return [float(point.split()[1]) for point in path.replace("M", "L").split("L")[1:]]


def test_equal_ratios_are_equal_distances_on_a_logarithmic_axis(page: Any) -> None:
    points = [[at, 10.0**-at] for at in range(5)]
    drawn = heights(draw(page, [{"name": "a", "points": points}], **LOG), "a")
    steps = [below - above for above, below in pairwise(drawn)]
    assert len(steps) == 4
    assert all(math.isclose(step, steps[0], abs_tol=0.11) and step > 20 for step in steps)


def test_every_series_has_its_line_and_its_last_value_in_the_legend(page: Any) -> None:
    series = [{"name": f"island {i}", "points": [[0, 1.0 * i], [5, 0.5 * i]]} for i in (1, 2, 3)]
    chart = draw(page, series, **LOG)
    assert chart.locator("path.line[data-name]").count() == 3
    assert chart.locator(".legend li").all_text_contents() == [
        "island 1 0.500",
        "island 2 1.00",
        "island 3 1.50",
    ]
    assert chart.locator(".legend data").last.get_attribute("value") == "1.5"


def test_faint_series_are_drawn_without_an_entry_in_the_legend(page: Any) -> None:
    points = [[0, 1.0], [1, 0.5]]
    chart = draw(page, [{"name": "one", "points": points, "faint": True}, {"name": "best", "points": points}])
    assert chart.locator("path.faint").count() == 1
    assert chart.locator(".legend li").all_text_contents() == ["best 0.500"]


def test_a_line_is_broken_where_a_value_is_missing_or_has_no_logarithm(page: Any) -> None:
    points = [[0, 1.0], [1, None], [2, 0.1], [3, 0.0], [4, 0.01], [5, -1.0]]
    path = draw(page, [{"name": "a", "points": points}], **LOG).locator("path[data-name]").get_attribute("d")
    assert (path.count("M"), path.count("L")) == (3, 0)
    assert "NaN" not in path
    assert "Infinity" not in path


def test_a_chart_without_anything_to_draw_is_not_shown(page: Any) -> None:
    for points in ([], [[0, None]], [[0, 0.0]]):
        assert draw(page, [{"name": "a", "points": points}], **LOG).is_hidden()


def test_a_single_point_and_a_constant_are_drawn(page: Any) -> None:
    for points in ([[3, 0.2]], [[0, 0.2], [1, 0.2]]):
        for options in (LOG, {}):
            drawn = heights(draw(page, [{"name": "a", "points": points}], **options), "a")
            assert len(drawn) == len(points)
            assert all(10 <= height <= 214 for height in drawn)


def test_arrow_keys_move_along_the_course_and_say_the_values(page: Any) -> None:
    series = [{"name": "a", "points": [[at, 1.0 / (at + 1)] for at in range(0, 50, 5)]}]
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


def test_the_mouse_reads_the_value_under_it_and_lets_go(page: Any) -> None:
    chart = draw(page, [{"name": "a", "points": [[at, float(at + 1)] for at in range(11)]}])
    box = chart.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + 58 + 1, box["y"] + 50)
    assert chart.locator(".legend").text_content() == "a 1.00"
    page.mouse.move(box["x"] + 58, box["y"] - 40)
    assert chart.locator(".legend").text_content() == "a 11.0"


def test_what_a_series_is_called_is_text(page: Any) -> None:
    name = "<img src=x onerror=alert(1)>"
    chart = draw(page, [{"name": name, "points": [[0, 1.0], [1, 2.0]]}])
    assert chart.locator(".legend li").text_content() == f"{name} 2.00"
    assert page.locator("img[src=x]").count() == 0


def test_thinning_keeps_the_ends_and_the_extremes(page: Any) -> None:
    points = [[at, math.sin(at / 300)] for at in range(10_000)]
    points[4321][1], points[8765][1] = 50.0, -50.0
    thin = call(page, "chart.js", "thinned", points, 100)
    assert len(thin) <= 2 * 100 + 2
    assert thin[0] == points[0]
    assert thin[-1] == points[-1]
    assert points[4321] in thin
    assert points[8765] in thin
    assert [point[0] for point in thin] == sorted({point[0] for point in thin})


def test_the_nearest_point_is_the_nearest_one(page: Any) -> None:
    points = [[0, 1], [2, 2], [10, 3]]
    for x, expected in ((-5, 0), (0.9, 0), (1.1, 2), (5.9, 2), (6.1, 10), (99, 10)):
        assert call(page, "chart.js", "nearest", points, x)[0] == expected


@pytest.mark.parametrize(
    ("low", "high"), [(0, 1), (-3.2, 7.7), (0, 500), (1e-9, 3e-9), (2, 2.0001), (0, 1e6)]
)
def test_round_marks_lie_within_an_axis_and_are_neither_few_nor_many(
    page: Any, low: float, high: float
) -> None:
    ticks = call(page, "scale.js", "roundTicks", low, high, 6)
    assert 2 <= len(ticks) <= 7
    assert all(low - 1e-9 * (high - low) <= tick <= high + 1e-9 * (high - low) for tick in ticks)
    assert ticks == sorted(set(ticks))


def test_marks_of_a_whole_axis_are_whole(page: Any) -> None:
    for last in (1, 2, 3, 4, 7, 9, 25):
        ticks = call(page, "scale.js", "roundTicks", 0.6, last + 0.4, 8, True)
        assert all(tick == int(tick) for tick in ticks)
        assert len(ticks) >= 1


@pytest.mark.parametrize(
    ("low", "high"), [(5e-3, 7e-3), (1e-3, 2e-2), (1e-12, 1e5), (0.9, 1.1), (1e-3, 1e-2)]
)
def test_marks_of_a_logarithmic_axis_lie_within_it(page: Any, low: float, high: float) -> None:
    ticks = call(page, "scale.js", "logTicks", low, high, 6)
    assert 2 <= len(ticks) <= 9
    assert all(low * (1 - 1e-6) <= tick <= high * (1 + 1e-6) for tick in ticks)


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
def test_numbers_are_written_with_significant_digits(page: Any, value: float | None, written: str) -> None:
    assert call(page, "numbers.js", "number", value) == written


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
def test_time_spans_are_written_by_their_greatest_units(page: Any, seconds: float, written: str) -> None:
    assert call(page, "numbers.js", "duration", seconds) == written


def test_best_and_worst_stand_for_islands_that_are_too_many(page: Any) -> None:
    points = [{"generation": g, "islands": [4.0 ** -(i % 3) for i in range(20)]} for g in range(3)]
    points[0]["islands"][0] = None
    series = call(page, "course.js", "islandSeries", points)
    named = [each for each in series if not each.get("faint")]
    assert len(series) == 22
    assert [(each["name"], each["points"][-1][1]) for each in named] == [
        ("best of 20 islands", 0.25),
        ("worst of 20 islands", 1.0),
    ]
    assert series[0]["points"][0][1] is None


def test_a_figure_of_the_browsers_own_store_does_not_turn_the_clock_back(page: Any) -> None:
    """It comes with the moment at which the service sent it first."""
    headers = {"Date": "Thu, 01 Jan 2026 00:00:00 GMT", "Cache-Control": "private, max-age=86400, immutable"}
    page.route("**/kept.svg", lambda route: route.fulfill(headers=headers, body="<svg/>"))
    told = page.evaluate("""async () => {
      const [api, clock] = await Promise.all([import("/dashboard/api.js"), import("/dashboard/clock.js")]);
      await api.json("/healthz");
      await api.blob("/kept.svg");
      return clock.age(new Date(Date.now() - 7_300_000).toISOString()).textContent;
    }""")
    page.unroute("**/kept.svg")
    assert told == "2 h ago"


def test_a_long_history_is_thinned_without_losing_its_end(page: Any) -> None:
    assert call(page, "course.js", "halved", list(range(10))) == [0, 2, 4, 6, 8, 9]
