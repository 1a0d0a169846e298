"""Second-order system ``m x'' + c x' + k x = u`` and its estimation from a record."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError

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
    found = [
        scipy.optimize.least_squares(compute_residual, start, method="lm", max_nfev=200)
        for start in starts[:REFINED_STARTS]
    ]
    best = min(found, key=lambda each: float(each.cost)).x
    _, weights = solve_linear(best)
    mass, damping, stiffness = _make_parameters(best, given, FASTEST / dt)
    if not scale_known:
        if weights[0] == 0.0:
            raise RecordError(
                "the input does not affect the output, so m, c and k cannot be estimated: give them"
            )
        mass, damping, stiffness = (each / weights[0] for each in (1.0, damping / mass, stiffness / mass))
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
