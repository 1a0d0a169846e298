"""Confusion matrix: positions, colours and legibility."""

from collections.abc import Mapping
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.report.figures.confusion import draw_confusion
from islands.report.figures.style import FRAME, RESIDUAL, SIMULATED, save
from islands_measurements.detection.injection.piezo import PIEZO

if TYPE_CHECKING:
    from matplotlib.figure import Figure


COUNTS: Mapping[tuple[str, str], int] = {
    ("delay", "delay"): 4,
    ("delay", "offset"): 4,
    ("offset", "offset"): 6,
    ("offset", ""): 2,
    ("ripple", "unknown"): 3,
    ("ripple", "missing-term"): 2,
    ("ripple", "delay"): 1,
    ("", ""): 20,
}
NAMES = ("offset", "delay", "jump")


def rows(figure: "Figure") -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_yticklabels()]


def columns(figure: "Figure") -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_xticklabels()]


@pytest.fixture(scope="module")
def figure() -> "Figure":
    return draw_confusion(COUNTS, NAMES, "a title")


def test_names_follow_the_catalogue_with_unnamed_entries_last(figure: "Figure") -> None:
    assert rows(figure) == ["offset", "delay", "ripple", "nothing"]
    assert columns(figure) == ["offset", "delay", "missing-term", "unknown", "nothing"]


def test_counts_are_written_in_their_cells(figure: "Figure") -> None:
    cells = {
        (
            rows(figure)[int(text.get_position()[1])],
            columns(figure)[int(text.get_position()[0])],
        ): text.get_text()
        for text in figure.axes[0].texts
    }
    assert cells == {
        (injected or "nothing", named or "nothing"): str(n) for (injected, named), n in COUNTS.items()
    }


@pytest.mark.parametrize(
    ("cell", "colour", "share"),
    [
        (("delay", "delay"), RESIDUAL, 0.5),
        (("delay", "offset"), SIMULATED, 0.5),
        (("offset", "nothing"), FRAME, 0.25),
        (("ripple", "unknown"), RESIDUAL, 1 / 2),
        (("ripple", "missing-term"), RESIDUAL, 1 / 3),
        (("ripple", "delay"), SIMULATED, 1 / 6),
        (("nothing", "nothing"), RESIDUAL, 1.0),
    ],
)
def test_colours_distinguish_right_wrong_and_unnamed(
    figure: "Figure", cell: tuple[str, str], colour: str, share: float
) -> None:
    from matplotlib.colors import to_rgb

    patches = {
        (rows(figure)[int(each.get_y())], columns(figure)[int(each.get_x())]): each.get_facecolor()[:3]
        for each in figure.axes[0].patches
    }
    tint = 0.25 + 0.75 * share
    assert patches[cell] == pytest.approx(1 - tint * (1 - np.array(to_rgb(colour))))


def test_labels_of_a_full_catalogue_are_legible() -> None:
    """Names are neither cut off nor overlapping, and numbers fit into their cells."""
    names = [*PIEZO.known, *(f"another-effect-{number}" for number in range(5))]
    every = {(name, name): 100 for name in names} | {("", ""): 300, ("ripple", "unknown"): 50}
    figure = draw_confusion(every, names, "every name of the catalogue")
    figure.draw_without_rendering()
    axes, page = figure.axes[0], figure.bbox
    cell = axes.get_window_extent().width / len(columns(figure))
    for label in (*axes.get_xticklabels(), *axes.get_yticklabels()):
        box = label.get_window_extent()
        assert page.x0 <= box.x0, label
        assert box.x1 <= page.x1, label
        assert box.y1 <= page.y1, label
    assert all(label.get_window_extent().height <= cell for label in axes.get_yticklabels())
    assert all(text.get_window_extent().width <= cell for text in axes.texts)
    assert min(label.get_fontsize() for label in axes.get_yticklabels()) >= 6.0


def test_title_does_not_touch_the_names(figure: "Figure") -> None:
    figure.draw_without_rendering()
    title = figure._suptitle.get_window_extent()
    assert all(label.get_window_extent().y1 < title.y0 for label in figure.axes[0].get_xticklabels())


def test_equal_counts_give_equal_files() -> None:
    first, second = BytesIO(), BytesIO()
    for stream in (first, second):
        save(draw_confusion(COUNTS, NAMES), stream)
    assert first.getvalue() == second.getvalue()


def test_empty_counts_give_an_empty_matrix() -> None:
    assert rows(draw_confusion({}, NAMES)) == []
