"""Numbers of a figure as a table."""

import csv
import io
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray


def tabulate_lines(figure: Figure) -> str:
    """Return the points of all lines of a figure as CSV, one in each row.

    Parameters
    ----------
    figure : Figure
        Figure made by a function of this package. Long lines of it have fewer points than the record, see
        `islands.report.figures.lines`.

    Returns
    -------
    str
        Columns ``panel`` (axes by number, with the labels of both axes), ``line`` (as in the legend, or its
        number), ``x`` and ``y``. A gap of a line is a row without ``y``. Of vertical lines, as of a
        correlation, each is a row. Marks, bands and bars are left out.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("panel", "line", "x", "y"))
    for number, axes in enumerate(figure.axes, start=1):
        panel = f"{number}: {axes.get_ylabel() or axes.get_title(loc='left')} over {_find_abscissa(axes)}"
        for position, (name, points) in enumerate(_list_lines(axes), start=1):
            line = f"line {position}" if name.startswith("_") else name
            writer.writerows((panel, line, *map(_format, point)) for point in points)
    return stream.getvalue()


def _list_lines(axes: Axes) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the label and the points of each line, and of each set of vertical lines."""
    for line in axes.lines:
        # Lines across the axes, as at zero, are marks.
        if line.get_transform() == axes.transData:
            columns = [np.asarray(each, dtype=np.float64) for each in line.get_data()]
            yield str(line.get_label()), np.column_stack(columns)
    for lines in axes.collections:
        if isinstance(lines, LineCollection):
            yield str(lines.get_label()), np.array([ends[-1] for ends in lines.get_segments()])


def _find_abscissa(axes: Axes) -> str:
    """Return the label of the abscissa, which the lowest of panels above each other has."""
    column = [each for each in axes.figure.axes if np.isclose(each.get_position().x0, axes.get_position().x0)]
    labels = [each.get_xlabel() for each in column[column.index(axes) :]]
    return next(filter(None, labels), "")


def _format(value: float) -> str:
    return f"{value:.8g}" if np.isfinite(value) else ""
