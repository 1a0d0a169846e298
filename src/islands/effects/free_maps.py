"""Maps of the free forms: each as a function, as an equation, and the labels of its values."""

from itertools import pairwise

import numpy as np

from islands.effects.filters import low_pass
from islands.effects.interface.effect import Signal, SimulationContext
from islands.effects.interface.map_equation import MapEquation
from islands.kernels.curve import PLACES, VALUES, interpolate_curve, write_curve
from islands.kernels.memory_operators import lag_unevenly, play_from

#: Time constants of a free filter: from the sampling time to this fraction of the estimation part.
TIME_CONSTANTS, LONGEST = 6, 0.1

#: Half widths of the plays of a free memory, relative to the peak of the signal.
HALF_WIDTHS = (0.03, 0.06, 0.12, 0.25, 0.5)

#: Labels of the time constants of a free lag.
LAG_LABELS = ("falling fast", "falling slowly", "rising slowly", "rising fast")


def label_places(_context: SimulationContext) -> list[str]:
    """Return the labels of the values of a curve."""
    return [f"at {place:g}" for place in PLACES]


def label_times(context: SimulationContext) -> list[str]:
    """Return the labels of the values of a curve over time."""
    return [f"at {time:.3g} s" for time in _times(context)[1:]]


def label_half_widths(_context: SimulationContext) -> list[str]:
    """Return the labels of the weights of plays."""
    return [f"play {half_width:g}" for half_width in HALF_WIDTHS]


def label_time_constants(context: SimulationContext) -> list[str]:
    """Return the labels of the weights of low-passes."""
    return [f"tau {tau:.3g} s" for tau in _time_constants(context)]


def _times(context: SimulationContext) -> Signal:
    return np.linspace(0.0, context.fit_end_time, VALUES + 2)


def _time_constants(context: SimulationContext) -> Signal:
    return np.geomspace(context.dt, LONGEST * context.fit_end_time, TIME_CONSTANTS)


def add_curve(signal: Signal, values: Signal, peak: float) -> Signal:
    """Add a curve over a signal, whose range is given by the peak."""
    return signal + interpolate_curve(signal / peak, values)


def write_added_curve(peak: float) -> MapEquation:
    """Write `add_curve`."""
    return MapEquation(f"x + {write_curve(f'x/{peak}')}")


def add_low_passes(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Add what low-passes change, weighted by the values."""
    parts = [low_pass(signal, tau, context.dt) - signal for tau in _time_constants(context)]
    return signal + values @ np.array(parts)


def write_low_passes(context: SimulationContext) -> MapEquation:
    """Write `add_low_passes`."""
    return _write_changes([("low-pass", str(tau)) for tau in _time_constants(context)])


def _typical_rate(context: SimulationContext, peak: float) -> float:
    """Return a typical rate of a signal per second, from scales that an extended simulation keeps."""
    coordinate = context.force_coordinate
    return peak * coordinate.rate / (coordinate.peak or 1.0)


def lag_by_rate(signal: Signal, values: Signal, context: SimulationContext, peak: float) -> Signal:
    """Lag a signal with time constants that depend on its rate, which is slow or fast for the signal."""
    lagged: Signal = lag_unevenly(signal, context.dt, _typical_rate(context, peak), values)
    return lagged


def write_lag_by_rate(context: SimulationContext, peak: float) -> MapEquation:
    """Write `lag_by_rate`."""
    values = [f"n{place}" for place in range(len(LAG_LABELS))]
    return MapEquation("z0", (("lag-unevenly", str(_typical_rate(context, peak)), *values),))


def add_plays(signal: Signal, values: Signal, peak: float) -> Signal:
    """Add what plays change, weighted by the values."""
    return signal + values @ np.array([play_from(signal, part * peak) - signal for part in HALF_WIDTHS])


def write_plays(peak: float) -> MapEquation:
    """Write `add_plays`."""
    return _write_changes([("play", str(part * peak)) for part in HALF_WIDTHS])


def _write_changes(operators: list[tuple[str, ...]]) -> MapEquation:
    changes = [f"n{place}*(z{place} - x)" for place in range(len(operators))]
    return MapEquation(" + ".join(["x", *changes]), tuple(operators))


def interpolate_time(values: Signal, context: SimulationContext) -> Signal:
    """Return a curve over time that is zero at the start; the last value is held in the hold-out part."""
    return np.interp(context.time, _times(context), [0.0, *values])


def write_time_curve(context: SimulationContext) -> str:
    """Write `interpolate_time` as an expression: a sum of ramps."""
    times = _times(context)
    ramps = []
    for place, (first, last) in enumerate(pairwise(times.tolist())):
        rise = f"(n{place} - n{place - 1})" if place else "n0"
        ramps.append(f"{rise}*min(max((t - {first})/{last - first}, 0), 1)")
    return f"({' + '.join(ramps)})"


def multiply_over_time(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    """Multiply a signal by one and a curve over time."""
    return signal * (1.0 + interpolate_time(values, context))


def write_time_factor(context: SimulationContext) -> MapEquation:
    """Write `multiply_over_time`."""
    return MapEquation(f"x*(1 + {write_time_curve(context)})")
