"""Progress bars: the completed fraction and the time left."""

import pytest
from rich.progress import Progress

from islands.cli.progress_display import FractionColumn


@pytest.mark.parametrize(
    ("fraction", "text"),
    [(0.01, ""), (0.25, "25%, 30 s left"), (0.05, "5%, 3 min left"), (1.0, "100%, 0 s left")],
)
def test_bar_shows_the_fraction_and_the_time_left(fraction: float, text: str) -> None:
    seconds = 0.0
    bar = Progress(FractionColumn(), get_time=lambda: seconds, disable=True)
    task = bar.add_task("", total=1.0, completed=fraction)
    seconds = 10.0
    assert FractionColumn().render(bar.tasks[task]).plain == text
