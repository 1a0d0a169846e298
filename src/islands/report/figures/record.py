"""Inputs and output of a record over time, as in Figure 4 of the paper."""

from matplotlib.figure import Figure

from islands.records.dataset import Dataset
from islands.report.figures.diverging_lines import break_line
from islands.report.figures.downsampling import downsample
from islands.report.figures.style import FRAME, MEASURED, RESIDUAL, blank, finish, house_style, label


@house_style()
def draw_record(record: Dataset, title: str = "") -> Figure:
    """Draw every input and, below them, the output; segments are separated by gaps and lines."""
    names = [*record.input_names, record.output_name]
    units = [*record.input_units, record.output_unit]
    figure = blank(1.0 + 1.3 * len(names), title)
    panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for axes, name, unit, values in zip(panels, names, units, [*record.u.T, record.y], strict=True):
        colour = MEASURED if axes is panels[-1] else RESIDUAL
        line = downsample(break_line(record, record.time), break_line(record, values))
        axes.plot(*line, color=colour, linewidth=0.7)
        axes.set_ylabel(label(name, unit))
        for begin, _ in record.bounds[1:]:
            axes.axvline(record.time[begin], color=FRAME, linewidth=0.6)
    panels[-1].set_xlabel("time (s)")
    return finish(figure)
