"""Figures 4 to 6 of the paper, and those of its search, in the themes of a page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.report.figures.lines import downsample
from islands.report.figures.style import (
    MEASURED_WIDTH,
    SIMULATED_WIDTH,
    STEPS,
    Theme,
    blank,
    finish,
    label,
    themed_style,
)


@dataclass(frozen=True, slots=True, eq=False)
class Reproduced:
    """A record and the free run of a model on it.

    Attributes
    ----------
    record : Dataset
        The output is NaN if it is unknown.
    simulated : ndarray, shape (samples,)
    """

    record: Dataset
    simulated: NDArray[np.float64]

    def __getitem__(self, rows: slice) -> "Reproduced":
        return Reproduced(self.record[rows], self.simulated[rows])


def draw_training_data(record: Dataset, theme: str = "light") -> Figure:
    """Draw input and output over time (Figure 4).

    Parameters
    ----------
    record : Dataset
    theme : str
        An entry of `islands.report.figures.style.THEMES`.
    """
    with themed_style(theme) as colours:
        figure = blank(3.2)
        above, below = figure.subplots(2, 1, sharex=True)
        for axes, values, colour, name, unit in (
            (above, record.u[:, 0], colours.inputs[0], record.input_names[0], record.input_units[0]),
            (below, record.y, colours.output, record.output_name, record.output_unit),
        ):
            axes.plot(*downsample(record.time, values), color=colour, lw=0.7)
            axes.set_ylabel(label(name, unit))
            axes.margins(x=0.01)
        below.set_xlabel("time (s)")
        figure.align_ylabels()
        return finish(figure)


def draw_validation(
    validation: Reproduced, loading: Reproduced, unloading: Reproduced, theme: str = "light"
) -> Figure:
    """Draw a validation as in Figures 5 and 6: over time, as a loop, and with an input that becomes constant.

    Parameters
    ----------
    validation, loading, unloading : Reproduced
        The record of (a) and (b), of (c), and of (d).
    theme : str
        An entry of `islands.report.figures.style.THEMES`.

    Returns
    -------
    Figure
        Four axes, (a) to (d). In (a), (c) and (d) the input has the scale of the output.
    """
    with themed_style(theme) as colours:
        figure = blank(5.4)
        panels = figure.subplots(2, 2)
        for axes, shown, title in (
            (panels[0, 0], validation, "(a) validation"),
            (panels[1, 0], loading, "(c) constant input after loading"),
            (panels[1, 1], unloading, "(d) constant input after unloading"),
        ):
            _draw_over_time(axes, shown, colours)
            axes.set_title(title)
        _draw_loop(panels[0, 1], validation, colours)
        panels[0, 1].set_title("(b) output over input")
        lines = panels[0, 0].get_legend_handles_labels()
        figure.legend(*lines, loc="outside lower center", ncols=3)
        return finish(figure)


def _draw_over_time(axes: Axes, shown: Reproduced, colours: Theme) -> None:
    record = shown.record
    output = label(record.output_name, record.output_unit)
    drive = label(record.input_names[0], record.input_units[0])
    axes.plot(*downsample(record.time, record.u[:, 0]), color=colours.inputs[0], lw=0.8, label="input")
    _draw_pair(axes, record.time, shown, colours)
    axes.margins(x=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=STEPS))
    axes.set(xlabel="time (s)", ylabel=f"{output}, {drive}")


def _draw_loop(axes: Axes, shown: Reproduced, colours: Theme) -> None:
    record = shown.record
    _draw_pair(axes, record.u[:, 0], shown, colours)
    axes.set_xlabel(label(record.input_names[0], record.input_units[0]))
    axes.set_ylabel(label(record.output_name, record.output_unit))


def _draw_pair(axes: Axes, x: NDArray[np.float64], shown: Reproduced, colours: Theme) -> None:
    measured, simulated = downsample(x, shown.record.y), downsample(x, shown.simulated)
    axes.plot(*measured, color=colours.output, lw=MEASURED_WIDTH, label="system")
    axes.plot(
        *simulated, color=colours.mark, lw=1.4 * SIMULATED_WIDTH, ls=(0, (5, 2)), label="model, free run"
    )


def draw_shares(
    shares: Mapping[str, Sequence[tuple[Sequence[int], Sequence[float]]]], theme: str = "light"
) -> Figure:
    """Draw which share of the hall of fame has Property 1 over the generations, a line for each search.

    Parameters
    ----------
    shares : mapping
        Generations and shares in per cent of each search, by the name of the kind of search; two kinds at
        most.
    theme : str
        An entry of `islands.report.figures.style.THEMES`.
    """
    with themed_style(theme) as colours:
        figure = blank(2.8)
        axes = figure.subplots()
        for (name, searches), colour in zip(shares.items(), (colours.inputs[0], colours.mark), strict=False):
            for number, (generations, percent) in enumerate(searches):
                named = name if number == 0 else None
                axes.plot(
                    generations, percent, color=colour, lw=1.2, alpha=0.8, marker=".", ms=4, label=named
                )
        axes.set(xlabel="generation", ylabel="hall with Property 1 (%)", ylim=(-4.0, 104.0))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return finish(figure)


def draw_errors_by_switch(
    errors: Mapping[str, Sequence[float]], published: float, theme: str = "light"
) -> Figure:
    """Draw the error of every search as a point and their median as a line, by the changed switch.

    Parameters
    ----------
    errors : mapping
        Errors in per cent of the searches of each switch, by its name.
    published : float
        Error of the paper, drawn as a vertical line.
    theme : str
        An entry of `islands.report.figures.style.THEMES`.
    """
    with themed_style(theme) as colours:
        figure = blank(1.0 + 0.32 * len(errors))
        axes = figure.subplots()
        axes.axvline(published, color=colours.mark, lw=1.0, ls="--", label="published, (13)")
        for row, values in enumerate(errors.values()):
            named = ("a search", "median") if row == 0 else (None, None)
            axes.plot(
                values,
                [row] * len(values),
                "o",
                ms=4,
                mew=0,
                alpha=0.6,
                color=colours.inputs[0],
                label=named[0],
            )
            middle = float(np.median(values))
            axes.plot([middle, middle], [row - 0.3, row + 0.3], color=colours.output, lw=2.0, label=named[1])
        axes.set_yticks(range(len(errors)), list(errors))
        axes.set_ylim(len(errors) - 0.5, -0.5)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        # Labels of all minor ticks of a decade would overlap.
        axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
        axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("MAPE of the validation over 100 s (%)")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return finish(figure)
