"""Confusion matrix: positions, colours and legibility."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.report.figures.confusion import draw_confusion
from islands.report.figures.style import FRAME, RESIDUAL, SIMULATED

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
