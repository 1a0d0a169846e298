"""What a model does where its record does not go: holds, minor loops, other amplitudes and other rates.

Accuracy on one more sine is cheap. What a hysteresis model owes its user is that it stays where it is when
the input rests, wherever it was and from whichever side it came (Property 1 of the paper, section 3).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset, join
from islands.estimation.parameter_constraints import PROPERTY_1
from islands.model import rendering
from islands.model.clusters import OUTPUT_AT_REST, clusters
from islands.model.model import Model
from islands.simulation.predictors import divergence_bound, free_run
from islands.systems.signals import hold_signal, minor_loops, sine

#: A cluster's sum meets its target within this.
SUM_TOLERANCE = 1e-9

#: A hold is constant when the output moves less than this share of its range over the second half.
CONSTANT = 1e-6

#: Levels of a hold as fractions of the input's amplitude about its middle.
LEVELS = (-0.8, -0.4, 0.0, 0.4, 0.8)

#: A hold lasts this many periods of the loop before it, an excursion is repeated this often.
HOLD_PERIODS, PERIODS = 20, 4

#: Other amplitudes and rates, as multiples of the record's own.
EXCURSIONS = (("amplitude", 0.5), ("rate", 0.25), ("rate", 5.0))

#: No input rests longer than this many samples: a very slow record is checked at a faster rate.
_LONGEST = 100_000


@dataclass(frozen=True, slots=True)
class ClusterSum:
    """The sum of a cluster's parameters, and what it is when there is a continuum of equilibria."""

    cluster: str
    sum: float
    target: float

    @property
    def met(self) -> bool:
        """The sum meets its target to 1e-9."""
        return abs(self.sum - self.target) <= SUM_TOLERANCE


@dataclass(frozen=True, slots=True)
class HoldTest:
    """The output while the input rests.

    Attributes
    ----------
    level : float
        The input's level as a fraction of its amplitude about its middle.
    loading : bool
        Reached while loading, or while unloading.
    bounded, constant : bool
        The output stayed within the bound; it was constant over the second half.
    drift_percent : float
        How far the output moved from the first sample at rest to the last, in per cent of the record's
        output range; infinite after a divergence, or where the record's output is constant and it moved.
    """

    level: float
    loading: bool
    bounded: bool
    constant: bool
    drift_percent: float


@dataclass(frozen=True, slots=True)
class ExcursionTest:
    """The output under an excitation that the record does not hold.

    Attributes
    ----------
    name : str
        ``minor-loops``, ``amplitude x 0.5``, ``rate x 5``, ...
    bounded : bool
        The output stayed within the bound.
    closure_percent : float
        Distance of the output from one return of the input to the next, in per cent of the record's output
        range: a loop that repeats closes.
    range_percent : float
        The output's range, in per cent of the record's.
    """

    name: str
    bounded: bool
    closure_percent: float
    range_percent: float


@dataclass(frozen=True, slots=True)
class PhysicsChecks:
    """The physics check of a model.

    Attributes
    ----------
    clusters : tuple of ClusterSum
    holds : tuple of HoldTest
        At five levels, each reached while loading and while unloading.
    excursions : tuple of ExcursionTest
    """

    clusters: tuple[ClusterSum, ...]
    holds: tuple[HoldTest, ...]
    excursions: tuple[ExcursionTest, ...]

    @property
    def property_1(self) -> bool:
        """Every cluster's sum meets its target, and every hold stays bounded and constant.

        The sums alone would pass y(k) = 2.5 y(k-1) - 1.5 y(k-2), which diverges.
        """
        return all(entry.met for entry in self.clusters) and all(
            entry.bounded and entry.constant for entry in self.holds
        )

    @property
    def hold_drift_percent(self) -> float:
        """The largest drift of all holds, in per cent of the output's range."""
        return max(entry.drift_percent for entry in self.holds)


def check_physics(model: Model, record: Dataset) -> PhysicsChecks:
    """Check a model under excitations made from the record's own ranges and rate.

    The base loop is a sine over each input's whole range, its period such that its slope has the rms of the
    record's. All inputs of a model move together.

    Parameters
    ----------
    model : Model
        With parameters.
    record : Dataset
        Complete; it gives ranges, rate, bound, and an output to start from.
    """
    period = _period(record, model.maximum_lag)
    scenarios = [*_holds(period), *_excursions(period)]
    simulated = list(_responses(model, record, [signal for _, signal in scenarios]))
    holds, excursions = [], []
    for (kind, signal), y in zip(scenarios, simulated, strict=True):
        if isinstance(kind, tuple):
            at_rest = y[len(y) - HOLD_PERIODS * period + model.maximum_lag :]
            holds.append(_hold(kind, at_rest, record.output_range))
        else:
            excursions.append(_excursion(kind, signal, y, record.output_range))
    return PhysicsChecks(cluster_sums(model), tuple(holds), tuple(excursions))


def cluster_sums(model: Model) -> tuple[ClusterSum, ...]:
    """Return the sums of the parameters over the clusters, beside their targets.

    The cluster of y comes first. Where no regressor is y at rest its sum is 0: an output that is not fed back
    has one equilibrium, not a continuum.
    """
    sums = {group.steady_state: group.total(model.parameters) for group in clusters(model.regressors)}
    return tuple(
        ClusterSum(rendering.at_rest(state, model.inputs), total, PROPERTY_1.get(state, 0.0))
        for state, total in ({OUTPUT_AT_REST: 0.0} | sums).items()
    )


def hold_response(
    model: Model, record: Dataset, level: float = 0.4, loading: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return input (in fractions of its amplitude) and output of one hold, for a figure."""
    signal = _hold_signal(_period(record, model.maximum_lag), level, loading)
    return signal, next(_responses(model, record, [signal]))


def _period(record: Dataset, maximum_lag: int) -> int:
    """Return the period in samples of a sine with range and rms slope of the first input that varies."""
    u = record.u[:, int(np.argmax(np.ptp(record.u, axis=0) > 0))]
    slope = np.concatenate([np.diff(u[begin:end]) for begin, end in record.bounds])
    amplitude = np.ptp(u) / 2
    period = 2 * np.pi * amplitude / np.sqrt(2 * np.mean(slope**2)) if slope.any() else 0
    return int(np.clip(period, max(40, 4 * maximum_lag), _LONGEST // HOLD_PERIODS))


_Kind = str | tuple[float, bool]


def _holds(period: int) -> list[tuple[_Kind, NDArray[np.float64]]]:
    return [
        ((level, loading), _hold_signal(period, level, loading))
        for level in LEVELS
        for loading in (True, False)
    ]


def _hold_signal(period: int, level: float, loading: bool) -> NDArray[np.float64]:
    return hold_signal(
        1.0, HOLD_PERIODS * period, amplitude=1.0, frequency=1.0 / period, level=level, loading=loading
    )


def _excursions(period: int) -> list[tuple[_Kind, NDArray[np.float64]]]:
    made: list[tuple[_Kind, NDArray[np.float64]]] = [
        ("minor-loops", minor_loops(1.0, amplitude=1.0, frequency=1.0 / period))
    ]
    for kind, factor in EXCURSIONS:
        amplitude, rate = (factor, 1.0) if kind == "amplitude" else (1.0, factor)
        samples = max(8, round(period / rate))
        made.append((f"{kind} x {factor:g}", sine(1.0, PERIODS * samples + 1, amplitude, 1.0 / samples)))
    return made


def _responses(
    model: Model, record: Dataset, signals: Sequence[NDArray[np.float64]]
) -> Iterator[NDArray[np.float64]]:
    """Yield the model's output for every signal, NaN from a divergence on.

    Each starts at rest in the middle of the inputs' range, from an output that was measured nearby.
    """
    middle = (record.u.max(axis=0) + record.u.min(axis=0)) / 2
    amplitude = np.ptp(record.u, axis=0) / 2
    nearest = int(np.argmin(np.abs(record.u - middle).sum(axis=1)))
    rest = model.maximum_lag
    recordings = []
    for signal in signals:
        u = middle + amplitude * np.concatenate([np.zeros(rest), signal])[:, None]
        y = np.full(len(u), np.nan)
        y[:rest] = record.y[nearest]
        recordings.append(
            Dataset(u, y, record.dt, record.input_names, record.output_name, record.input_units)
        )
    joined = join(tuple(recordings))
    simulated = free_run(model, joined, bound=divergence_bound(record)).y
    for begin, end in joined.bounds:
        yield simulated[begin + rest : end]


def _hold(kind: tuple[float, bool], y: NDArray[np.float64], output_range: float) -> HoldTest:
    """Judge the output from where every lag of the input has its level: before that it may still answer."""
    level, loading = kind
    # A divergence on the way to the level leaves NaN at rest as well.
    bounded = not np.isnan(y).any()
    drift = percent_of_range(y[-1] - y[0], output_range) if bounded else np.inf
    moves = np.ptp(y[len(y) // 2 :]) if bounded else np.inf
    return HoldTest(level, loading, bounded, bool(moves <= CONSTANT * output_range), drift)


def _excursion(
    name: str, signal: NDArray[np.float64], y: NDArray[np.float64], output_range: float
) -> ExcursionTest:
    bounded = not np.isnan(y).any()
    if not bounded:
        return ExcursionTest(name, False, np.inf, np.inf)
    # The last return of the input to its largest value, and the one before it: two samples side by side, as
    # near to a crest from before as from behind, are one return.
    largest = np.flatnonzero(signal >= signal.max() * (1 - 1e-9))
    before, last = largest[np.diff(largest, prepend=-2) > 1][-2:]
    return ExcursionTest(
        name,
        True,
        percent_of_range(y[last] - y[before], output_range),
        percent_of_range(np.ptp(y), output_range),
    )


def percent_of_range(distance: float, output_range: float) -> float:
    """Return a distance in per cent of a range; of a range of 0 it is nothing, or infinitely much."""
    share = abs(float(distance)) / output_range if output_range > 0 else np.inf
    return 100 * share if distance else 0.0
