"""The confusion matrix of blind trials: what was hidden, and what it was called."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from islands.figures.style import FRAME, RESIDUAL, SHADE, SIMULATED, WIDTH, blank, finish, house_style

#: What "" stands for, and what was noticed without a name.
NOTHING, UNKNOWN = "nothing", "unknown"

#: Inches of a name in the margin, and of a cell at the most.
_MARGIN, _CELL = 1.35, 0.26

#: Points of names and numbers in a cell of an inch, and at the most.
_TEXT, _LARGEST = 46.0, 8.0

#: The palest tint of a cell that holds anything.
_PALE = 0.25


@house_style()
def draw_confusion(counts: Mapping[tuple[str, str], int], names: Sequence[str], title: str = "") -> Figure:
    """Draw how often what was hidden was called what.

    A row is what was hidden, a column what it was called. A row's colours are shares of its trials: blue
    where the name is right, red where it is another one, grey where there is none.

    Parameters
    ----------
    counts : mapping of (str, str) to int
        (hidden, called) to how often; "" is nothing, hidden or found, "unknown" is noticed without a name.
    names : sequence of str
        The catalogue's, in the order in which they are drawn. What was hidden beside them has no name: to
        call it unknown is right.
    title : str
    """
    rows, columns = _order(counts, names)
    cell = min(_CELL, (WIDTH - _MARGIN - 0.1) / max(len(columns), 1))
    height = cell * max(len(rows), 1) + _MARGIN + (0.35 if title else 0.1)
    figure = blank(height, title)
    figure.set_layout_engine("none")  # cells are squares of a size that is known
    axes = figure.add_axes(
        (
            _MARGIN / WIDTH,
            0.08 / height,
            cell * len(columns) / WIDTH,
            cell * max(len(rows), 1) / height,
        )
    )
    size = min(_LARGEST, _TEXT * cell)
    for down, hidden in enumerate(rows):
        total = sum(counts.get((hidden, called), 0) for called in columns)
        for across, called in enumerate(columns):
            _cell(
                axes, (across, down), counts.get((hidden, called), 0), total, _colour(hidden, called, names)
            )
    _frame(axes, rows, columns, size)
    for text in axes.texts:
        text.set_fontsize(size * (0.85 if len(text.get_text()) < 3 else 0.65))
    return finish(figure)


def _order(
    counts: Mapping[tuple[str, str], int], names: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what stands in the rows and in the columns: what occurs, and for every row its own column."""
    hidden = {each for each, _ in counts}
    known = [name for name in names if name in hidden]
    other = sorted(hidden - {*names, ""})
    rows = (*known, *other, *([""] if "" in hidden else []))
    called = {each for _, each in counts} | set(known)
    beside = sorted(called - {*names, "", UNKNOWN})
    return rows, (*(name for name in names if name in called), *beside, UNKNOWN, "")


def _colour(hidden: str, called: str, names: Sequence[str]) -> str:
    right = called == hidden or (called == UNKNOWN and hidden not in names and hidden != "")
    if right:
        return RESIDUAL
    return FRAME if called in ("", UNKNOWN) else SIMULATED


def _cell(axes: Axes, place: tuple[int, int], count: int, total: int, colour: str) -> None:
    if not count:
        return
    share = count / total
    tint = _PALE + (1.0 - _PALE) * share
    mixed = tuple(1.0 - tint * (1.0 - part) for part in to_rgb(colour))
    axes.add_patch(Rectangle(place, 1, 1, facecolor=mixed, edgecolor="none", zorder=1.5))
    axes.text(
        place[0] + 0.5,
        place[1] + 0.53,
        str(count),
        ha="center",
        va="center",
        color="white" if np.dot(mixed, (0.3, 0.6, 0.1)) < 0.55 else "black",
    )


def _frame(axes: Axes, rows: Sequence[str], columns: Sequence[str], size: float) -> None:
    axes.set(xlim=(0, len(columns)), ylim=(max(len(rows), 1), 0))
    axes.set_xticks(np.arange(len(columns)) + 0.5, [each or NOTHING for each in columns], rotation=90)
    axes.set_yticks(np.arange(len(rows)) + 0.5, [each or NOTHING for each in rows])
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0, labelsize=size)
    axes.grid(visible=False)
    axes.hlines(np.arange(1, len(rows)), 0, len(columns), color=SHADE, lw=0.4, zorder=1)
    axes.vlines(np.arange(1, len(columns)), 0, len(rows), color=SHADE, lw=0.4, zorder=1)
    # What has no name stands apart.
    axes.axvline(len(columns) - 2, color=FRAME, lw=0.8)
    for side in axes.spines.values():
        side.set_visible(True)
