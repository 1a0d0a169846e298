"""Overview of a record: signals over time, spectra, input-output plane and impulse response."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from islands.records.dataset import Dataset
from islands.records.inspection.channel import Channel, channels
from islands.records.inspection.excitation import estimate_spectrum
from islands.records.inspection.impulse_response import estimate_impulse_response
from islands.records.inspection.record_facts import RecordFacts
from islands.report.figures.lines import break_line, downsample
from islands.report.figures.style import REMARK, STEPS, Theme, blank, finish, label, themed_style

#: Inputs that are drawn, at most.
_MOST_INPUTS = 3

#: Smallest power density that is shown, in decibels relative to its maximum.
_LEAST_POWER = -65.0

#: Vertices of the line in the input-output plane.
_VERTICES = 6000


def draw_overview(record: Dataset, facts: RecordFacts, theme: str = "light") -> Figure:
    """Draw every signal with its spectrum, the output over the first input, and the impulse response.

    Parameters
    ----------
    record : Dataset
        Of many inputs, the first three are drawn.
    facts : RecordFacts
        Facts of the record, which mark bands and the dead time.
    theme : str
        An entry of `islands.report.figures.style.THEMES`.
    """
    with themed_style(theme) as colours:
        return _draw(record, facts, colours)


def _draw(record: Dataset, facts: RecordFacts, colours: Theme) -> Figure:
    *inputs, output = channels(record)
    shown = [*inputs[:_MOST_INPUTS], output]
    figure = blank(0.6 + 1.15 * len(shown) + 2.1)
    grid = figure.add_gridspec(
        len(shown) + 1, 2, width_ratios=(1.9, 1.0), height_ratios=(*(1.0 for _ in shown), 1.8)
    )
    times: Axes | None = None
    for row, channel in enumerate(shown):
        colour = colours.output if channel.is_output else colours.inputs[row]
        last = row == len(shown) - 1
        times = figure.add_subplot(grid[row, 0], sharex=times)
        _draw_signal(times, record, channel, colour, last)
        _draw_spectrum(
            figure.add_subplot(grid[row, 1]), record, channel, colour, facts, colours, row == 0, last
        )
    _draw_plane(figure.add_subplot(grid[-1, 0]), record, output, inputs[0], colours)
    _draw_response(figure.add_subplot(grid[-1, 1]), record, facts, colours)
    return finish(figure)


def _draw_signal(axes: Axes, record: Dataset, channel: Channel, colour: str, last: bool) -> None:
    line = downsample(break_line(record, record.time), break_line(record, channel.values))
    axes.plot(*line, color=colour, linewidth=0.7)
    axes.set_ylabel(label(channel.name, channel.unit))
    axes.margins(x=0.01)
    if last:
        axes.set_xlabel("time (s)")
    else:
        axes.tick_params(labelbottom=False)


def _draw_spectrum(
    axes: Axes,
    record: Dataset,
    channel: Channel,
    colour: str,
    facts: RecordFacts,
    colours: Theme,
    first: bool,
    last: bool,
) -> None:
    """Draw the power density relative to its maximum, with the band of 95 % of an input's power."""
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    values = channel.values[begin:end]
    values = np.where(np.isfinite(values), values, np.nanmean(values))
    frequency, power = (part[1:] for part in estimate_spectrum(values, record.dt))
    if power.size and power.max() > 0.0:
        decibels = 10.0 * np.log10(np.maximum(power / power.max(), 10.0 ** (0.1 * _LEAST_POWER)))
        axes.semilogx(frequency, decibels, color=colour, linewidth=0.8)
        axes.set_ylim(_LEAST_POWER, 5.0)
        axes.set_yticks([-60.0, -40.0, -20.0, 0.0])
    # Powers of ten as text of mathematics would be shown as they are.
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.minorticks_off()
    for fact in facts.facts:
        if fact.name == "band" and fact.signal == channel.name and fact.interval is not None:
            low = max(fact.interval[0], frequency[0])
            axes.axvspan(low, fact.interval[1], color=colours.mark, alpha=0.13, linewidth=0.0)
    if first:
        axes.set_title("power in dB, 95 % shaded", fontsize=REMARK)
    if last:
        axes.set_xlabel("frequency (Hz)")
    else:
        axes.tick_params(labelbottom=False)


def _draw_plane(axes: Axes, record: Dataset, output: Channel, driven: Channel, colours: Theme) -> None:
    line = downsample(break_line(record, driven.values), break_line(record, output.values), _VERTICES)
    axes.plot(*line, color=colours.output, linewidth=0.5, alpha=0.8)
    axes.set_xlabel(label(driven.name, driven.unit))
    axes.set_ylabel(label(output.name, output.unit))


def _draw_response(axes: Axes, record: Dataset, facts: RecordFacts, colours: Theme) -> None:
    """Draw the impulse response to the first input with its 95 % band, and the dead time."""
    response = estimate_impulse_response(record, 0)
    axes.set_xlabel("lag (samples)")
    if response is None or not (np.abs(response.values) > response.errors).any():
        text = "no impulse response is visible:\nthe input does not excite it"
        axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    lags = np.arange(len(response.values))
    axes.fill_between(lags, -response.errors, response.errors, color=colours.frame, alpha=0.25, linewidth=0.0)
    axes.plot(lags, response.values, color=colours.inputs[0], linewidth=1.0, marker=".", markersize=3.0)
    axes.set_title("impulse response, chance in grey", fontsize=REMARK)
    axes.locator_params(axis="x", steps=STEPS, integer=True)
    for fact in facts.facts:
        if fact.name == "dead-time" and fact.signal == record.input_names[0] and fact.value is not None:
            axes.axvline(float(fact.value), color=colours.mark, linewidth=0.9, linestyle="--")
            text = f"dead time {fact.value:.0f}"
            axes.text(0.97, 0.95, text, ha="right", va="top", color=colours.mark, transform=axes.transAxes)
