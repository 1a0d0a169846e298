"""Estimates of the parameters and states of the built-in simulators from a record.

Their equations are the files in `simulators/built_in`.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy

from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.segments import is_resting
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.preparation import make_ode_simulator
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.record_channels import make_nominal_context
from islands.simulators.ode.sampled_signal import interpolate_linearly
from islands.simulators.ode.shooting import smooth
from islands.simulators.ode.system import OdeSystem
from islands.simulators.second_order import estimate_second_order

#: Trial values of the time in which the lower tank empties, relative to the duration of the record.
_EMPTYING_TIMES = np.geomspace(0.005, 0.2, 8)

#: Trial values of the level of the upper tank, relative to that of the lower tank.
_LEVEL_RATIOS = (0.3, 1.0, 3.0)

#: Rate vs within which the dry friction of an axis changes its sign, relative to the typical rate.
_RELATIVE_RATE = 0.01

#: Windows of the filter whose estimates of an axis are compared, in samples.
_WINDOWS = (9, 17, 33, 65)

#: Least and most integration steps per sample of an axis. A friction that changes its sign within one step
#: makes the error of the simulation an irregular function of vs, and its calibration ends at a local minimum:
#: the nominal vs is passed in four steps or more, and no smaller vs in less than one.
_STEPS = (4, 32)

#: A system with estimated parameters, and estimates of its states at the first sample by name.
Estimate = tuple[OdeSystem, Mapping[str, float]]


def estimate_oscillator(system: OdeSystem, given: Mapping[str, float], record: Dataset) -> Estimate:
    """Estimate the parameters of ``second-order`` that are not given; of several recordings from the longest.

    Parameters
    ----------
    system : OdeSystem
    given : mapping
        Known parameters.
    record : Dataset
        Estimation part of the record.
    """
    part = record.longest_segment
    found = estimate_second_order(part.u[:, 0], part.y, part.dt, given)
    # Bounds of the damping are relative to critical damping, since its value may be close to zero.
    critical = 2.0 * abs(found.stiffness / found.mass) ** 0.5 * found.mass
    ends = (min(0.0, 10.0 * critical), max(0.0, 10.0 * critical))
    values = {"m": found.mass, "c": found.damping, "k": found.stiffness}
    return _set(system, values, {"c": ends}), {"x": found.position, "v": found.rate}


def estimate_tanks(system: OdeSystem, given: Mapping[str, float], record: Dataset) -> Estimate:
    """Estimate the parameters and levels of ``cascaded-tanks``; arguments as of `estimate_oscillator`.

    Each point of a grid satisfies the balance of mean flows. The point whose free run has the smallest error
    is the initial value of the calibration.
    """
    part = record.longest_segment
    u, y = np.ascontiguousarray(part.u[:, 0]), part.y
    level, pumped = max(float(np.mean(y)), 1e-6), max(abs(float(np.mean(u))), 1e-6)
    first = max(float(y[0]), 0.0)
    points = []
    for emptying_time in _EMPTYING_TIMES * part.samples * part.dt:
        for ratio in _LEVEL_RATIOS:
            k2 = given.get("k2", 2.0 * level**0.5 / emptying_time)
            k1 = given.get("k1", k2 / ratio**0.5)
            k3 = given.get("k3", k2 * level**0.5 / pumped)
            points.append(({"k1": k1, "k2": k2, "k3": k3}, {"upper": first * ratio, "lower": first}))
    signals = {system.input: interpolate_linearly(u)}
    limits = {each.name: (each.lower, each.upper) for each in system.states}
    lanes = [LaneInput(values, levels, signals, limits=limits) for values, levels in points]
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.mean((simulate_lanes(generate_program(system), part.dt, lanes)[:, 0] - y) ** 2, axis=1)
    values, levels = points[int(np.argmin(np.nan_to_num(errors, nan=np.inf)))]
    bounds = {name: (0.02 * value, 50.0 * value) for name, value in values.items()}
    return _set(system, values, bounds), levels


def estimate_axis(system: OdeSystem, given: Mapping[str, float], record: Dataset) -> Estimate:
    """Estimate the parameters of ``rigid-axis``; arguments as of `estimate_oscillator`.

    The estimate uses the inverse dynamics: least squares of the force on smoothed acceleration, rate and
    direction (Olsen and Petersen 2001). Noise of the acceleration makes the mass too small, and a long window
    of the filter smooths the motion, so that the window with the smallest error of a simulation is used.

    Raises
    ------
    RecordError
        The axis rests.
    """
    if is_resting(record.y):
        raise RecordError(
            f"column {record.output_name} is constant: the parameters of {system.name} are estimated from a "
            "motion; select other rows"
        )
    shortest = min(record.segments)
    candidates = [_invert_axis(system, given, record, each) for each in _WINDOWS if each <= shortest]
    part = record.longest_segment
    return min(candidates, key=lambda each: _measure_error(each, part)), {}


def _measure_error(system: OdeSystem, record: Dataset) -> float:
    """Return the mean squared error of a simulation of one recording; infinity if it diverges."""
    try:
        simulator = make_ode_simulator(system, record)
    except RecordError:
        return np.inf
    context = make_nominal_context(record)
    nominal = np.array([each.nominal for each in simulator.parameters])
    return float(np.mean((simulator.simulate(nominal, context.u, context, {}, ()) - record.y) ** 2))


def _invert_axis(system: OdeSystem, given: Mapping[str, float], record: Dataset, window: int) -> OdeSystem:
    """Return an axis whose parameters fit the force of a record that is smoothed with a window."""
    rate, acceleration = (smooth(record.y, record, order, window) for order in (1, 2))
    typical_rate = float(np.std(rate)) or 1.0
    columns = np.column_stack([acceleration, rate, np.tanh(rate / (0.02 * typical_rate))])
    names = ("m", "c", "F")
    free = [place for place, name in enumerate(names) if name not in given]
    known = np.array([given.get(name, 0.0) for name in names])
    force = smooth(record.u[:, 0], record, window=window)
    known[free] = scipy.optimize.lsq_linear(
        columns[:, free], force - columns @ known, bounds=(1e-12, np.inf)
    ).x
    mass, damping, dry = map(float, known)
    # Bounds of friction are relative to a typical force, since the friction may be close to zero.
    most = 20.0 * (dry + damping * typical_rate + mass * typical_rate / (system.shooting / 5.0))
    slip_rate = given.get("vs", _RELATIVE_RATE * typical_rate)
    change = dry / mass * record.dt  # of the rate within a sample
    steps = 2 ** int(np.ceil(np.log2(np.clip(4.0 * change / slip_rate, *_STEPS))))
    values = {"m": mass, "c": damping, "F": dry, "vs": slip_rate}
    lower = min(max(0.05 * slip_rate, change / steps), slip_rate)
    bounds = {"c": (0.0, most / typical_rate), "F": (0.0, most), "vs": (lower, 20.0 * slip_rate)}
    return _set(replace(system, steps=steps), values, bounds)


def _set(
    system: OdeSystem, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> OdeSystem:
    """Return a system with other values and bounds of parameters."""
    parameters = system.with_values(values).parameters
    bounded = [
        replace(each, lower=bounds[each.name][0], upper=bounds[each.name][1]) if each.name in bounds else each
        for each in parameters
    ]
    return replace(system, parameters=tuple(bounded))
