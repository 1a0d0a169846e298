"""States of the effects of a monitored simulation over the records, with alarms."""

from datetime import datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.diagnosis.monitoring.record_follower import MonitorState
from islands.effects.interface.context import Signal
from islands.report.figures.style import (
    BAND,
    FRAME,
    MEASURED,
    REMARK,
    RESIDUAL,
    SHADE,
    SIMULATED,
    STEPS,
    blank,
    finish,
    house_style,
    label,
)

#: Number of parameters, and of further effects, that are shown at most.
_MAX_PARAMETERS, _MAX_EFFECTS = 8, 3


@house_style()
def draw_monitored_states(state: MonitorState) -> Figure:
    """Draw parameters with 95 % intervals, scores of effects, noise and test statistic over the records.

    Effects that alarms name have a panel first, then those with the largest scores. A line marks the record
    that raised an alarm, a band the 95 % interval of the first changed record.
    """
    reference = state.reference
    if reference is None:
        return finish(blank(1.0, "No record"))
    effects = _choose_effects(state)
    parameters = reference.parameters[:_MAX_PARAMETERS]
    count = len(parameters) + len(effects) + 2
    alarms = len(state.alarms)
    title = f"{len(state.records)} records, {alarms} {'alarm' if alarms == 1 else 'alarms'}"
    figure = blank(0.8 + 0.95 * count, title)
    panels = figure.subplots(count, sharex=True, squeeze=False)[:, 0]
    places, has_times = _get_places(state)
    values = np.array([each.states.values for each in state.records])
    errors = np.array([each.states.errors for each in state.records])
    scores = np.array([each.states.scores for each in state.records])
    for index, (axes, parameter) in enumerate(zip(panels, parameters, strict=False)):
        _draw_intervals(axes, places, values[:, index], 1.96 * errors[:, index])
        axes.plot(places, values[:, index], ".", ms=3, color=MEASURED)
        axes.set_ylabel(label(parameter.name.replace(" ", "\n", 1), parameter.unit))
    for axes, index in zip(panels[len(parameters) :], effects, strict=False):
        axes.plot(places, scores[:, index], ".", ms=3, color=RESIDUAL)
        axes.axhline(0.0, color=FRAME, lw=0.6)
        axes.set_ylabel(f"{reference.directions[index].effect}\nscore (sigma)")
    panels[-2].plot(places, [each.states.noise for each in state.records], ".", ms=3, color=MEASURED)
    panels[-2].set_ylabel("noise")
    _draw_statistic(panels[-1], state, places)
    for axes in panels:
        axes.yaxis.set_major_locator(MaxNLocator(3, steps=STEPS))
        _mark_alarms(axes, state, places)
    _annotate_alarms(panels[0], state, places)
    panels[-1].set_xlabel("time of the record" if has_times else "record")
    if has_times:
        locator = AutoDateLocator()  # type: ignore[no-untyped-call]
        panels[-1].xaxis.set_major_locator(locator)
        panels[-1].xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    figure.align_ylabels()
    return finish(figure)


def _choose_effects(state: MonitorState) -> list[int]:
    assert state.reference is not None
    names = [each.effect for each in state.reference.directions]
    named = [names.index(alarm.cause) for alarm in state.alarms if alarm.cause in names]
    if not names:
        return []
    latest = np.array([each.states.scores for each in state.records[-state.settings.training :]])
    largest = np.argsort(-np.abs(np.mean(latest, axis=0)), kind="stable")
    return list(dict.fromkeys([*named, *map(int, largest)]))[:_MAX_EFFECTS]


def _get_places(state: MonitorState) -> tuple[Signal, bool]:
    """Return the times of the records if all of them are known and increase, otherwise their indices."""
    times = [each.time for each in state.records]
    if all(times) and times == sorted(times):
        found = [datetime.fromisoformat(each) for each in times]
        return np.asarray(date2num(found), dtype=np.float64), True  # type: ignore[no-untyped-call]
    return np.arange(len(times), dtype=np.float64), False


def _draw_intervals(axes: Axes, places: Signal, values: Signal, limits: Signal) -> None:
    """Draw vertical intervals as one line with gaps: a line for each would be most of the file."""
    ends = np.column_stack([values - limits, values + limits, np.full_like(values, np.nan)])
    axes.plot(np.repeat(places, 3), ends.ravel(), color=FRAME, lw=0.7)


def _draw_statistic(axes: Axes, state: MonitorState, places: Signal) -> None:
    known = {index: each.statistic for index, each in enumerate(state.records) if each.statistic is not None}
    statistics = list(known.values())
    axes.plot(places[list(known)], statistics, ".", ms=3, color=MEASURED)
    axes.axhline(state.threshold, color=SIMULATED, lw=0.9, ls="--")
    axes.set_ylim(0.0, 1.25 * max([state.threshold, *statistics]))
    axes.set_ylabel("statistic\nand limit")
    first = min(state.settings.training, len(state.records)) - 1
    axes.axvspan(places[0], places[first], color=SHADE, zorder=0.2)


def _mark_alarms(axes: Axes, state: MonitorState, places: Signal) -> None:
    for alarm in state.alarms:
        axes.axvspan(places[alarm.earliest], places[alarm.latest], color=BAND, zorder=0.3)
        axes.axvline(places[alarm.since], color=SIMULATED, lw=0.7, ls=":")
        axes.axvline(places[alarm.record], color=SIMULATED, lw=1.0)


def _annotate_alarms(axes: Axes, state: MonitorState, places: Signal) -> None:
    for number, alarm in enumerate(state.alarms):
        text = (
            f"{alarm.cause} {alarm.kind}".strip() if alarm.cause not in str(alarm.kind) else str(alarm.kind)
        )
        axes.annotate(
            text,
            (places[alarm.record], 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(2, 2 + 9 * (number % 2)),
            textcoords="offset points",
            fontsize=REMARK,
            color=SIMULATED,
            ha="right" if alarm.record > 0.7 * len(state.records) else "left",
        )
