"""A second-order system, ``m x'' + c x' + k x = u``, and how one is estimated from a record."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError

Signal = NDArray[np.float64]

#: Natural frequencies and dampings that a search begins from, and how many of the best are refined.
FREQUENCIES, DAMPINGS, REFINED = 40, (0.003, 0.02, 0.1, 0.4, 1.0), 3


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """Parameters, in the units of the record; ``position`` and ``rate`` are those of the first sample."""

    mass: float
    damping: float
    stiffness: float
    position: float = 0.0
    rate: float = 0.0


def estimate_second_order(u: Signal, y: Signal, dt: float, given: Mapping[str, float]) -> SecondOrder:
    """Estimate what is not given of ``m``, ``c``, ``k`` by least squares of the simulated output.

    The response is linear in 1/m and in the state at the first sample, which are solved for; frequency and
    damping are searched for (variable projection, Golub and Pereyra 1973).

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
    dt : float
        Seconds.
    given : mapping
        Values by name: m, c, k.

    Raises
    ------
    SettingsError
        The mass that is given is zero.
    RecordError
        Nothing is given, and nothing moves.
    """
    if given.get("m") == 0.0:
        raise SettingsError("a mass of zero does not move as a second-order system: give another m")
    # One value that is not zero says how large the response is: only the beginning is free then.
    sized = any(given.values())

    def solved(point: Signal) -> tuple[Signal, Signal]:
        system = _of(point, given)
        columns = _columns(u, dt, *system)
        if sized:
            fixed = columns[:, 0] / system[0]
            free = np.linalg.lstsq(columns[:, 1:], y - fixed, rcond=None)[0]
            return y - fixed - columns[:, 1:] @ free, np.concatenate([[1.0 / system[0]], free])
        weights: Signal = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0])
        return y - columns @ weights, weights

    def missed(point: Signal) -> Signal:
        # What explodes is as bad as can be, and its squares are numbers still.
        with np.errstate(all="ignore"):
            return np.clip(np.nan_to_num(solved(point)[0], nan=1e100), -1e100, 1e100)

    slowest, fastest = 2 * np.pi / (y.size * dt), 0.8 * np.pi / dt
    starts = [
        np.log([frequency, damping])
        for frequency in np.geomspace(slowest, fastest, FREQUENCIES)
        for damping in DAMPINGS
    ]
    starts.sort(key=lambda point: float(np.sum(missed(point) ** 2)))
    found = [
        scipy.optimize.least_squares(missed, start, method="lm", max_nfev=200) for start in starts[:REFINED]
    ]
    best = min(found, key=lambda each: float(each.cost)).x
    _, weights = solved(best)
    mass, damping, stiffness = _of(best, given)
    if not sized:
        if weights[0] == 0.0:
            raise RecordError("the input does not move the output: nothing tells m, c and k; give them")
        mass, damping, stiffness = (each / weights[0] for each in (1.0, damping / mass, stiffness / mass))
    return SecondOrder(mass, damping, stiffness, float(weights[1]), float(weights[2]))


def _of(point: Signal, given: Mapping[str, float]) -> tuple[float, float, float]:
    """Return mass, damping and stiffness at a logarithm of frequency and of damping."""
    frequency, damping = np.exp(np.clip(point, -40.0, 40.0))
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


def _columns(u: Signal, dt: float, mass: float, damping: float, stiffness: float) -> Signal:
    """Return the responses of a unit mass to the input, to a position and to a rate, shape (samples, 3)."""
    c, k = damping / mass, stiffness / mass
    unit = ([1.0], [1.0, c, k])
    # At rest at the first sample: a ramp up to it, as a filter's first step would be, is taken out.
    forced = sum(
        scipy.signal.lfilter(*map(np.ravel, scipy.signal.cont2discrete(unit, dt, method=hold)[:2]), pushed)
        for hold, pushed in (("foh", u - u[0]), ("zoh", np.full(u.size, u[0])))
    )
    step = scipy.linalg.expm(dt * np.array([[0.0, 1.0], [-k, -c]]))
    trace, determinant = float(np.trace(step)), float(np.linalg.det(step))
    # The free motion obeys x(j) = trace x(j-1) - determinant x(j-2), by Cayley and Hamilton.
    pulse = np.zeros(u.size)
    pulse[0] = 1.0
    free = [
        scipy.signal.lfilter([start, first - trace * start], [1.0, -trace, determinant], pulse)
        for start, first in ((1.0, step[0, 0]), (0.0, step[0, 1]))
    ]
    return np.column_stack([forced, *free])
