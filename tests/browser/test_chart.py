"""Charts, scales and number formats, tested in the browser."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

from support.screen import Screen
from support.service_processes import Service

pytestmark = pytest.mark.ci

CHART = """async ({ options, series }) => {
  const { makeLineChart } = await import("/dashboard/components/chart.js");
  const labels = { title: "Errors", x: { label: "generation" }, y: { label: "RMS error" } };
  const chart = makeLineChart({ ...labels, ...options });
  document.getElementById("main").replaceChildren(chart.node);
  chart.draw(series);
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""

LOG = {"y": {"label": "RMS error", "log": True}}


@pytest.fixture(scope="module")
def page(chromium: Any, desk: Service) -> Iterator[Any]:
    """One page for all tests: each chart replaces the previous one."""
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
    """Return the ordinates of the path of a line."""
    path = chart.locator(f"path[data-name='{name}']").get_attribute("d")
    return [float(point.split()[1]) for point in path.replace("M", "L").split("L")[1:]]


def test_long_tick_labels_do_not_cover_the_title_of_the_axis(page: Any) -> None:
    chart = draw(page, [{"name": "a", "points": [[0, 1.02345e-4], [1, 1.02346e-4]]}])
    assert max(map(len, chart.locator("text.tick.end").all_text_contents())) > 8
    title = chart.get_by_text("RMS error").bounding_box()
    for tick in chart.locator("text.tick.end").all():
        assert tick.bounding_box()["x"] > title["x"] + title["width"]


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


def test_a_line_is_interrupted_at_missing_or_nonpositive_values(page: Any) -> None:
    points = [[0, 1.0], [1, None], [2, 0.1], [3, 0.0], [4, 0.01], [5, -1.0]]
    path = draw(page, [{"name": "a", "points": points}], **LOG).locator("path[data-name]").get_attribute("d")
    assert (path.count("M"), path.count("L")) == (3, 0)
    assert "NaN" not in path
    assert "Infinity" not in path


def test_a_chart_without_data_is_hidden(page: Any) -> None:
    for points in ([], [[0, None]], [[0, 0.0]]):
        assert draw(page, [{"name": "a", "points": points}], **LOG).is_hidden()


def test_a_single_point_and_a_constant_are_drawn(page: Any) -> None:
    for points in ([[3, 0.2]], [[0, 0.2], [1, 0.2]]):
        for options in (LOG, {}):
            drawn = heights(draw(page, [{"name": "a", "points": points}], **options), "a")
            assert len(drawn) == len(points)
            assert all(10 <= height <= 214 for height in drawn)


def test_arrow_keys_move_the_pointer_and_announce_the_values(page: Any) -> None:
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


def test_the_mouse_shows_the_value_under_it_until_it_leaves(page: Any) -> None:
    chart = draw(page, [{"name": "a", "points": [[at, float(at + 1)] for at in range(11)]}])
    box = chart.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + 58 + 1, box["y"] + 50)
    assert chart.locator(".legend").text_content() == "a 1.00"
    page.mouse.move(box["x"] + 58, box["y"] - 40)
    assert chart.locator(".legend").text_content() == "a 11.0"


def test_the_name_of_a_series_is_not_interpreted_as_markup(page: Any) -> None:
    name = "<img src=x onerror=alert(1)>"
    chart = draw(page, [{"name": name, "points": [[0, 1.0], [1, 2.0]]}])
    assert chart.locator(".legend li").text_content() == f"{name} 2.00"
    assert page.locator("img[src=x]").count() == 0


def test_downsampling_keeps_the_ends_and_the_extremes(page: Any) -> None:
    points = [[at, math.sin(at / 300)] for at in range(10_000)]
    points[4321][1], points[8765][1] = 50.0, -50.0
    thin = call(page, "components/chart.js", "downsample", points, 100)
    assert len(thin) <= 2 * 100 + 2
    assert thin[0] == points[0]
    assert thin[-1] == points[-1]
    assert points[4321] in thin
    assert points[8765] in thin
    assert [point[0] for point in thin] == sorted({point[0] for point in thin})


def test_the_nearest_point_matches_an_exhaustive_search(page: Any) -> None:
    points = [[0, 1], [2, 2], [10, 3]]
    for x, expected in ((-5, 0), (0.9, 0), (1.1, 2), (5.9, 2), (6.1, 10), (99, 10)):
        assert call(page, "components/chart.js", "findNearest", points, x)[0] == expected


@pytest.mark.parametrize(
    ("low", "high"), [(0, 1), (-3.2, 7.7), (0, 500), (1e-9, 3e-9), (2, 2.0001), (0, 1e6)]
)
def test_round_ticks_are_within_the_axis_and_of_suitable_number(page: Any, low: float, high: float) -> None:
    ticks = call(page, "lib/scale.js", "roundTicks", low, high, 6)
    assert 2 <= len(ticks) <= 7
    assert all(low - 1e-9 * (high - low) <= tick <= high + 1e-9 * (high - low) for tick in ticks)
    assert ticks == sorted(set(ticks))


def test_ticks_of_an_integer_axis_are_integers(page: Any) -> None:
    for last in (1, 2, 3, 4, 7, 9, 25):
        ticks = call(page, "lib/scale.js", "roundTicks", 0.6, last + 0.4, 8, True)
        assert all(tick == int(tick) for tick in ticks)
        assert len(ticks) >= 1


@pytest.mark.parametrize(
    ("low", "high"), [(5e-3, 7e-3), (1e-3, 2e-2), (1e-12, 1e5), (0.9, 1.1), (1e-3, 1e-2)]
)
def test_ticks_of_a_logarithmic_axis_are_within_it(page: Any, low: float, high: float) -> None:
    ticks = call(page, "lib/scale.js", "logTicks", low, high, 6)
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


def test_many_islands_are_summarised_by_best_and_worst(page: Any) -> None:
    points = [{"generation": g, "islands": [4.0 ** -(i % 3) for i in range(20)]} for g in range(3)]
    points[0]["islands"][0] = None
    series = call(page, "components/convergence.js", "makeIslandSeries", points)
    named = [each for each in series if not each.get("faint")]
    assert len(series) == 22
    assert [(each["name"], each["points"][-1][1]) for each in named] == [
        ("best of 20 islands", 0.25),
        ("worst of 20 islands", 1.0),
    ]
    assert series[0]["points"][0][1] is None


def test_a_cached_figure_does_not_change_the_clock(page: Any) -> None:
    """The cached response has the date of the first one."""
    headers = {"Date": "Thu, 01 Jan 2026 00:00:00 GMT", "Cache-Control": "private, max-age=86400, immutable"}
    page.route("**/kept.svg", lambda route: route.fulfill(headers=headers, body="<svg/>"))
    age = page.evaluate("""async () => {
      const modules = [import("/dashboard/lib/api.js"), import("/dashboard/lib/clock.js")];
      const [api, clock] = await Promise.all(modules);
      await api.getJson("/healthz");
      await api.getBlob("/kept.svg");
      return clock.makeAge(new Date(Date.now() - 7_300_000).toISOString()).textContent;
    }""")
    page.unroute("**/kept.svg")
    assert age == "2 h ago"


def test_halving_a_history_keeps_its_last_point(page: Any) -> None:
    assert call(page, "components/convergence.js", "halve", list(range(10))) == [0, 2, 4, 6, 8, 9]


def test_a_label_has_the_unit_once(page: Any) -> None:
    labels = [("CH1 [V]", "V"), ("Block (°C)", "°C"), ("u_V", "V"), ("u", None)]
    found = [call(page, "lib/numbers.js", "labelQuantity", *each) for each in labels]
    assert found == ["CH1 [V]", "Block (°C)", "u_V (V)", "u"]
