"""Confusion matrix of blind fault-injection trials: injected faults against named effects."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from islands.report.figures.style import FRAME, RESIDUAL, SHADE, SIMULATED, WIDTH, blank, finish, house_style

#: Label of "": no fault injected, or no effect found.
NOTHING = "nothing"

#: Label of a deviation that was detected but not named.
UNKNOWN = "unknown"

#: Margin for the names, in inches.
_MARGIN = 1.35

#: Largest width of a cell, in inches.
_CELL = 0.26

#: Font size of names and numbers per inch of cell width, in points.
_FONT_SIZE_PER_INCH = 48.0

#: Largest font size of names and numbers, in points.
_MAX_FONT_SIZE = 8.0

#: Smallest tint of a cell that is not empty.
_MIN_TINT = 0.25


@house_style()
def draw_confusion(counts: Mapping[tuple[str, str], int], names: Sequence[str], title: str = "") -> Figure:
    """Draw the confusion matrix of blind trials.

    Rows are injected faults, columns are named effects. The intensity of a colour is the fraction of the
    trials of its row. Blue cells are correct, orange cells wrong; grey cells have no name.

    Parameters
    ----------
    counts : mapping of (str, str) to int
        Number of trials by (injected, named). "" means no fault or no effect; "unknown" means detected but
        not named.
    names : sequence of str
        Names of the effects that can be injected, in the order in which they are drawn. For other faults,
        "unknown" is correct, and so are names that are none of these: missing terms and free forms.
    title : str
    """
    rows, columns = _order(counts, names)
    cell = min(_CELL, (WIDTH - _MARGIN - 0.1) / max(len(columns), 1))
    height = cell * max(len(rows), 1) + _MARGIN + (0.35 if title else 0.1)
    figure = blank(height, title)
    figure.set_layout_engine("none")  # cells are squares of a fixed size
    axes = figure.add_axes(
        (
            _MARGIN / WIDTH,
            0.08 / height,
            cell * len(columns) / WIDTH,
            cell * max(len(rows), 1) / height,
        )
    )
    size = min(_MAX_FONT_SIZE, _FONT_SIZE_PER_INCH * cell)
    for down, hidden in enumerate(rows):
        total = sum(counts.get((hidden, called), 0) for called in columns)
        for across, called in enumerate(columns):
            _draw_cell(
                axes, (across, down), counts.get((hidden, called), 0), total, _colour(hidden, called, names)
            )
    _draw_frame(axes, rows, columns, size)
    for text in axes.texts:
        text.set_fontsize(size * (0.85 if len(text.get_text()) < 3 else 0.65))
    return finish(figure)


def _order(
    counts: Mapping[tuple[str, str], int], names: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the rows and of the columns; every row of the catalogue has a column."""
    hidden = {each for each, _ in counts}
    known = [name for name in names if name in hidden]
    other = sorted(hidden - {*names, ""})
    rows = (*known, *other, *([""] if "" in hidden else []))
    called = {each for _, each in counts} | set(known)
    uncatalogued = sorted(called - {*names, "", UNKNOWN})
    return rows, (*(name for name in names if name in called), *uncatalogued, UNKNOWN, "")


def _colour(hidden: str, called: str, names: Sequence[str]) -> str:
    is_outside = hidden not in names and hidden != ""
    if called == hidden or (is_outside and called not in (*names, "")):
        return RESIDUAL
    return FRAME if called in ("", UNKNOWN) else SIMULATED


def _draw_cell(axes: Axes, place: tuple[int, int], count: int, total: int, colour: str) -> None:
    if not count:
        return
    share = count / total
    tint = _MIN_TINT + (1.0 - _MIN_TINT) * share
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


def _draw_frame(axes: Axes, rows: Sequence[str], columns: Sequence[str], size: float) -> None:
    axes.set(xlim=(0, len(columns)), ylim=(max(len(rows), 1), 0))
    axes.set_xticks(np.arange(len(columns)) + 0.5, [each or NOTHING for each in columns], rotation=90)
    axes.set_yticks(np.arange(len(rows)) + 0.5, [each or NOTHING for each in rows])
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0, labelsize=size)
    axes.grid(visible=False)
    axes.hlines(np.arange(1, len(rows)), 0, len(columns), color=SHADE, lw=0.4, zorder=1)
    axes.vlines(np.arange(1, len(columns)), 0, len(rows), color=SHADE, lw=0.4, zorder=1)
    # Separate the columns without a name.
    axes.axvline(len(columns) - 2, color=FRAME, lw=0.8)
    for side in axes.spines.values():
        side.set_visible(True)
