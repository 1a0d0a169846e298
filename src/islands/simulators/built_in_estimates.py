"""Estimates of the parameters and states of the built-in simulators from a record.

Their equations are the files in `simulators/built_in`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.records.segments import is_resting
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.sampled_signal import interpolate_linearly, make_nominal_context
from islands.simulators.ode.shooting import smooth
from islands.simulators.ode.simulator import make_ode_simulator
from islands.simulators.ode.system import OdeSystem

Signal = NDArray[np.float64]

#: Number of natural frequencies on the grid of starting points.
FREQUENCY_COUNT = 40

#: Damping ratios on the grid of starting points.
DAMPING_RATIOS = (0.003, 0.02, 0.1, 0.4, 1.0)

#: Largest natural frequency, and damping relative to the mass, of an estimate, relative to the sampling rate.
#: The samples do not determine faster ones, which diverge in one Runge-Kutta step per sample.
FASTEST = 2.5

#: Number of the best starting points that are refined.
REFINED_STARTS = 3

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


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """Parameters in the units of the record; ``position`` and ``rate`` are the state at the first sample."""

    mass: float
    damping: float
    stiffness: float
    position: float = 0.0
    rate: float = 0.0


def estimate_second_order(u: Signal, y: Signal, dt: float, given: Mapping[str, float]) -> SecondOrder:
    """Estimate the unknown parameters among ``m``, ``c``, ``k`` by least squares of the simulated output.

    The response is linear in 1/m and in the initial state, which are solved for in closed form. Frequency and
    damping are found by a nonlinear search (variable projection, Golub and Pereyra 1973).

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
        Input and output.
    dt : float
        Sampling time in seconds.
    given : mapping
        Known parameters by name: m, c, k.

    Raises
    ------
    SettingsError
        The given mass is zero.
    RecordError
        No nonzero parameter is given, and the input does not affect the output.
    """
    if given.get("m") == 0.0:
        raise SettingsError("a mass of zero does not define a second-order system: give another m")
    # A given nonzero value determines the scale of the response; then only the initial state is free.
    scale_known = any(given.values())

    def solve_linear(point: Signal) -> tuple[Signal, Signal]:
        system = _make_parameters(point, given, FASTEST / dt)
        columns = _make_responses(u, dt, *system)
        if scale_known:
            fixed = columns[:, 0] / system[0]
            free = np.linalg.lstsq(columns[:, 1:], y - fixed, rcond=None)[0]
            return y - fixed - columns[:, 1:] @ free, np.concatenate([[1.0 / system[0]], free])
        weights: Signal = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0])
        return y - columns @ weights, weights

    def compute_residual(point: Signal) -> Signal:
        # An unstable response gets the largest residual whose square is still finite.
        with np.errstate(all="ignore"):
            return np.clip(np.nan_to_num(solve_linear(point)[0], nan=1e100), -1e100, 1e100)

    slowest, fastest = 2 * np.pi / (y.size * dt), 0.8 * np.pi / dt
    starts = [
        np.log([frequency, damping])
        for frequency in np.geomspace(slowest, fastest, FREQUENCY_COUNT)
        for damping in DAMPING_RATIOS
    ]
    starts.sort(key=lambda point: float(np.sum(compute_residual(point) ** 2)))
    fits = [
        scipy.optimize.least_squares(compute_residual, start, method="lm", max_nfev=200)
        for start in starts[:REFINED_STARTS]
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    _, weights = solve_linear(best)
    mass, damping, stiffness = _make_parameters(best, given, FASTEST / dt)
    if not scale_known:
        if weights[0] == 0.0:
            raise RecordError(
                "the input does not affect the output, so m, c and k cannot be estimated: give them"
            )
        mass, damping, stiffness = (ratio / weights[0] for ratio in (1.0, damping / mass, stiffness / mass))
    return SecondOrder(mass, damping, stiffness, float(weights[1]), float(weights[2]))


def _make_parameters(point: Signal, given: Mapping[str, float], fastest: float) -> tuple[float, float, float]:
    """Return mass, damping and stiffness from the logarithms of natural frequency and damping ratio.

    The natural frequency and the damping relative to the mass are at most ``fastest``, in 1/s.
    """
    frequency, damping = np.exp(np.clip(point, -40.0, 40.0))
    frequency = min(frequency, fastest)
    damping = min(damping, fastest / (2.0 * frequency))
    if "m" in given:
        mass = given["m"]
    elif given.get("k"):
        mass = given["k"] / frequency**2
    elif given.get("c"):
        mass = given["c"] / (2.0 * damping * frequency)
    else:
        mass = 1.0
    return (
        float(mass),
        float(given.get("c", 2.0 * damping * frequency * mass)),
        float(given.get("k", frequency**2 * mass)),
    )


def _make_responses(u: Signal, dt: float, mass: float, damping: float, stiffness: float) -> Signal:
    """Return the unit-mass responses to the input, initial position and initial rate, shape (samples, 3)."""
    c, k = damping / mass, stiffness / mass
    unit = ([1.0], [1.0, c, k])
    # With first-order hold, the filter would add a ramp from zero to u[0] before the first sample. Splitting
    # off the constant u[0] avoids it.
    forced = sum(
        scipy.signal.lfilter(*map(np.ravel, scipy.signal.cont2discrete(unit, dt, method=hold)[:2]), part)
        for hold, part in (("foh", u - u[0]), ("zoh", np.full(u.size, u[0])))
    )
    step = scipy.linalg.expm(dt * np.array([[0.0, 1.0], [-k, -c]]))
    trace, determinant = float(np.trace(step)), float(np.linalg.det(step))
    # By the Cayley-Hamilton theorem the free motion is x(j) = trace x(j-1) - determinant x(j-2).
    pulse = np.zeros(u.size)
    pulse[0] = 1.0
    free = [
        scipy.signal.lfilter([start, first - trace * start], [1.0, -trace, determinant], pulse)
        for start, first in ((1.0, step[0, 0]), (0.0, step[0, 1]))
    ]
    return np.column_stack([forced, *free])


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
