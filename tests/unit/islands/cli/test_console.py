"""Progress bars: the completed fraction and the time left."""

import pytest
from rich.progress import Progress

from islands.cli.progress_display import FractionColumn
from islands.progress import TimeLeft


@pytest.mark.parametrize(
    ("fraction", "text"),
    [(0.01, "1%"), (0.25, "25%, 30 s left"), (0.05, "5%"), (0.1, "10%, 90 s left"), (1.0, "100%, 0 s left")],
)
def test_bar_shows_the_fraction_and_the_time_left(fraction: float, text: str) -> None:
    left = TimeLeft(0.0)
    left.update(fraction, 10.0)
    bar = Progress(FractionColumn(left), get_time=lambda: 10.0, disable=True)
    task = bar.add_task("", total=1.0, completed=fraction)
    assert FractionColumn(left).render(bar.tasks[task]).plain == text


def test_bar_counts_the_time_left_down_and_omits_it_when_a_step_takes_longer() -> None:
    left, times = TimeLeft(0.0), iter([10.0, 14.0, 18.0])
    left.update(0.5, 10.0)
    bar = Progress(FractionColumn(left), disable=True)
    task = bar.add_task("", total=1.0, completed=0.5)
    bar.tasks[task].get_time = lambda: next(times)
    shown = [FractionColumn(left).render(bar.tasks[task]).plain for _ in range(3)]
    assert shown == ["50%, 10 s left", "50%, 6 s left", "50%"]
