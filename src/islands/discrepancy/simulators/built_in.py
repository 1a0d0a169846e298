"""Estimates of the parameters and states of the built-in simulators from a record.

Their equations are the files in `islands.systems.built_in`.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.systems.ode.lane_simulation import LaneInput, interpolate_linearly, simulate_lanes
from islands.systems.ode.ode_program import generate_program
from islands.systems.ode.ode_system import OdeSystem
from islands.systems.second_order import estimate_second_order

#: Trial values of the time in which the lower tank empties, relative to the duration of the record.
_EMPTYING_TIMES = np.geomspace(0.005, 0.2, 8)

#: Trial values of the level of the upper tank, relative to that of the lower tank.
_LEVEL_RATIOS = (0.3, 1.0, 3.0)

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
    system = system.with_values({"m": found.mass, "c": found.damping, "k": found.stiffness})
    parameters = tuple(
        replace(each, lower=ends[0], upper=ends[1]) if each.name == "c" else each
        for each in system.parameters
    )
    return replace(system, parameters=parameters), {"x": found.position, "v": found.rate}


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
    return system.with_values(values), levels
