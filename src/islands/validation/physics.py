"""Physics checks: behaviour of a model under excitations that the record does not contain.

The excitations are holds, minor loops, and other amplitudes and rates. A hysteresis model must keep a
constant output at constant input, at every level and on both branches (Property 1 of the paper, section 3).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.parameter_constraints import PROPERTY_1
from islands.expressions import printing
from islands.kernels.characteristic_roots import converges
from islands.models.clusters import OUTPUT_AT_REST, clusters
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.records.compatibility import match_record
from islands.records.dataset import Dataset, join
from islands.rounding import RESOLUTION, ROUNDING
from islands.simulation.predictors import find_divergence_bound, free_run
from islands.systems.signals import hold_signal, minor_loops, sine

#: Levels of the holds relative to the midpoint of the input, as fractions of its amplitude.
LEVELS = (-0.8, -0.4, 0.0, 0.4, 0.8)

#: Levels beyond those of the holds: the recorded extremes, and 1.2 of them. They have no influence on the
#: recommended model.
EXTREMES = (-1.2, -1.0, 1.0, 1.2)

#: Largest distance of the output at an extreme from its recorded range, in ranges. The output of a slow
#: system leaves the range of a short record without a fault.
MOST_RANGES = 100.0

#: Length of a hold in periods of the preceding loop.
HOLD_PERIODS = 20

#: Number of periods of an excursion.
EXCURSION_PERIODS = 4

#: Amplitudes and rates of the excursions, as multiples of those of the record.
EXCURSIONS = (("amplitude", 0.5), ("rate", 0.25), ("rate", 5.0))

#: Maximum length of a hold in samples. A very slow record is checked at a faster rate.
_MAX_HOLD_SAMPLES = 100_000


@dataclass(frozen=True, slots=True)
class ClusterSum:
    """The sum of a cluster's parameters, and its target for a continuum of equilibria."""

    cluster: str
    sum: float
    target: float

    @property
    def met(self) -> bool:
        """Whether the sum meets its target to 1e-9."""
        return abs(self.sum - self.target) <= ROUNDING


@dataclass(frozen=True, slots=True)
class HoldTest:
    """The output at constant input.

    Attributes
    ----------
    level : float
        Level of the input relative to its midpoint, as a fraction of its amplitude.
    loading : bool
        Whether the level was reached while loading.
    bounded, constant : bool
        Whether the output stayed within the bound, and whether it was constant over the second half.
    drift_percent : float
        Change of the output from the sample at which all lagged inputs are at the level to the end of the
        hold, in per cent of the record's output range. Infinite after a divergence, or if the record's output
        is constant and the output changed.
    """

    level: float
    loading: bool
    bounded: bool
    constant: bool
    drift_percent: float


@dataclass(frozen=True, slots=True)
class ExcursionTest:
    """The output under an excitation that the record does not contain.

    Attributes
    ----------
    name : str
        ``minor-loops``, ``amplitude x 0.5``, ``rate x 5``, ...
    bounded : bool
        Whether the output stayed within the bound.
    closure_percent : float
        Difference of the output between the last two maxima of the input, in per cent of the record's output
        range. 0 for a closed loop, infinite after a divergence.
    range_percent : float
        Range of the output, in per cent of the record's output range. Infinite after a divergence.
    """

    name: str
    bounded: bool
    closure_percent: float
    range_percent: float


@dataclass(frozen=True, slots=True)
class ExtremeTest:
    """The output at an input that is held at a recorded extreme or beyond it.

    Attributes
    ----------
    level : float
        Level of the input relative to its midpoint, as a fraction of its amplitude.
    bounded : bool
        Whether the output stayed within the bound.
    ranges : float
        Largest distance of the output from its recorded range, in ranges. Infinite after a divergence, or if
        the recorded output is constant and the output changed.
    drift : float
        Difference of the means of the output over the third and the last quarter of the hold, in ranges: the
        output of an integrator moves on, that of a limit cycle or of a settled model does not.
    """

    level: float
    bounded: bool
    ranges: float
    drift: float

    @property
    def plausible(self) -> bool:
        """Whether the output is bounded and at most 100 ranges from its recorded range."""
        return self.bounded and self.ranges <= MOST_RANGES


@dataclass(frozen=True, slots=True)
class PhysicsChecks:
    """Results of the physics checks of a model.

    Attributes
    ----------
    clusters : tuple of ClusterSum
    convergent : bool
        Whether the linear output terms converge at constant input; true if their parameters do not sum to 1.
    holds : tuple of HoldTest
        Holds at five levels, each reached while loading and while unloading.
    excursions : tuple of ExcursionTest
    extremes : tuple of ExtremeTest
        Holds at the recorded extremes and at 1.2 of them.
    not_computed : str
        Why there are no checks; empty if there are. A model without checks has not failed any.
    """

    clusters: tuple[ClusterSum, ...]
    convergent: bool
    holds: tuple[HoldTest, ...]
    excursions: tuple[ExcursionTest, ...]
    extremes: tuple[ExtremeTest, ...] = ()
    not_computed: str = ""

    @property
    def property_1(self) -> bool:
        """Whether the cluster sums meet their targets, and the output converges at constant input.

        The sums are not sufficient: y(k) = 2.5 y(k-1) - 1.5 y(k-2) meets them but diverges. Nor are the
        holds: the output of y(k) = y(k-8) is constant in a hold if its last eight values were equal.
        """
        return (
            not self.not_computed
            and all(entry.met for entry in self.clusters)
            and self.convergent
            and all(entry.bounded and entry.constant for entry in self.holds)
        )

    @property
    def hold_drift_percent(self) -> float:
        """Largest drift of all holds, in per cent of the record's output range; NaN if there are none."""
        return max((entry.drift_percent for entry in self.holds), default=nan)


def missing_physics(reason: str) -> PhysicsChecks:
    """Return the checks of a model that were not computed."""
    return PhysicsChecks((), True, (), (), not_computed=reason)


def check_physics(model: DynamicModel, record: Dataset) -> PhysicsChecks:
    """Check a model under excitations derived from the ranges and the rate of the record.

    The base loop is a sine over the range of each input. Its rms slope equals that of the record, within
    limits of the period. All inputs of a model are excited simultaneously.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    record : Dataset
        Complete record that defines the ranges, the rate, the bound and the initial output.
    """
    record = match_record(model, record)
    plan = _plan_checks(record, model.maximum_lag)
    simulated = list(_simulate(model, record, plan.excitations))
    holds, excursions, extremes = [], [], []
    for (kind, signal), y in zip(plan.scenarios, simulated, strict=True):
        if isinstance(kind, tuple):
            at_rest = y[len(y) - HOLD_PERIODS * plan.period + model.maximum_lag :]
            holds.append(_evaluate_hold(kind, at_rest, record.output_range))
        elif isinstance(kind, float):
            extremes.append(_evaluate_extreme(kind, y, record))
        else:
            excursions.append(_evaluate_excursion(kind, signal, y, record.output_range))
    convergent = not isinstance(model, Model) or is_convergent(model)
    return PhysicsChecks(cluster_sums(model), convergent, tuple(holds), tuple(excursions), tuple(extremes))


def cluster_sums(model: DynamicModel) -> tuple[ClusterSum, ...]:
    """Return the sums of the parameters over the clusters, with their targets.

    The cluster of y comes first. Its sum is 0 if no regressor has the steady state y: without feedback of the
    output there is one equilibrium, not a continuum. So it is of a model that is not a NARX model.
    """
    groups = clusters(model.regressors) if isinstance(model, Model) else ()
    sums = {group.steady_state: group.total(model.parameters) for group in groups}
    return tuple(
        ClusterSum(printing.at_rest(state, model.inputs), total, PROPERTY_1.get(state, 0.0))
        for state, total in ({OUTPUT_AT_REST: 0.0} | sums).items()
    )


def is_convergent(model: Model) -> bool:
    """Return whether the linear output terms converge at constant input: to one equilibrium of a continuum.

    Their characteristic polynomial has a single root at 1, and all other roots inside the unit circle. True
    as well if their parameters do not sum to 1.
    """
    feedback = np.zeros(model.maximum_lag)
    for item, parameter in zip(model.regressors, model.parameters, strict=True):
        if item.output_lag:
            feedback[item.output_lag - 1] = parameter
    return bool(converges(feedback))


def hold_response(
    model: DynamicModel, record: Dataset, level: float = 0.4, loading: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the input (in fractions of its amplitude) and the output of one hold, for a figure."""
    signal = _make_hold(_choose_period(record, model.maximum_lag), level, loading)
    excitations = _make_excitations(record, model.maximum_lag, [signal])
    return signal, next(_simulate(model, record, excitations))


def _choose_period(record: Dataset, maximum_lag: int) -> int:
    """Return the period in samples of a sine with the range and rms slope of the first varying input."""
    u = record.u[:, int(np.argmax(np.ptp(record.u, axis=0) > 0))]
    slope = np.concatenate([np.diff(u[begin:end]) for begin, end in record.bounds])
    amplitude = np.ptp(u) / 2
    period = 2 * np.pi * amplitude / np.sqrt(2 * np.mean(slope**2)) if slope.any() else 0
    return int(np.clip(period, max(40, 4 * maximum_lag), _MAX_HOLD_SAMPLES // HOLD_PERIODS))


#: Name of an excursion, (level, loading) of a hold, or level of an extreme.
_Kind = str | tuple[float, bool] | float


class _Plan(NamedTuple):
    """Checks of all models with a largest lag on a record, and the record of their excitations."""

    period: int
    scenarios: list[tuple[_Kind, NDArray[np.float64]]]
    excitations: Dataset


# The excitations of recent calls are kept, like their layouts: a fit checks many models on one record.
@lru_cache(maxsize=8)
def _plan_checks(record: Dataset, maximum_lag: int) -> _Plan:
    period = _choose_period(record, maximum_lag)
    scenarios = [*_make_holds(period), *_make_excursions(period), *_make_extremes(period)]
    signals = [signal for _, signal in scenarios]
    return _Plan(period, scenarios, _make_excitations(record, maximum_lag, signals))


def _make_holds(period: int) -> list[tuple[_Kind, NDArray[np.float64]]]:
    return [
        ((level, loading), _make_hold(period, level, loading))
        for level in LEVELS
        for loading in (True, False)
    ]


def _make_hold(period: int, level: float, loading: bool) -> NDArray[np.float64]:
    return hold_signal(
        1.0, HOLD_PERIODS * period, amplitude=1.0, frequency=1.0 / period, level=level, loading=loading
    )


def _make_excursions(period: int) -> list[tuple[_Kind, NDArray[np.float64]]]:
    excursions: list[tuple[_Kind, NDArray[np.float64]]] = [
        ("minor-loops", minor_loops(1.0, amplitude=1.0, frequency=1.0 / period))
    ]
    for kind, factor in EXCURSIONS:
        amplitude, rate = (factor, 1.0) if kind == "amplitude" else (1.0, factor)
        samples = max(8, round(period / rate))
        excursions.append(
            (f"{kind} x {factor:g}", sine(1.0, EXCURSION_PERIODS * samples + 1, amplitude, 1.0 / samples))
        )
    return excursions


def _make_extremes(period: int) -> list[tuple[_Kind, NDArray[np.float64]]]:
    """Return a quarter of a sine from the midpoint to every extreme, and its hold."""
    rise = np.sin(0.5 * np.pi * np.arange(1, period // 4 + 1) / (period // 4))
    shape = np.concatenate([rise, np.ones(HOLD_PERIODS * period)])
    return [(level, level * shape) for level in EXTREMES]


def _make_excitations(record: Dataset, warm_up: int, signals: Sequence[NDArray[np.float64]]) -> Dataset:
    """Return a record with a segment for every signal.

    Each segment starts at the midpoint of the input ranges, with the measured output of the sample whose
    inputs are nearest to it.
    """
    midpoint = (record.u.max(axis=0) + record.u.min(axis=0)) / 2
    amplitude = np.ptp(record.u, axis=0) / 2
    nearest = int(np.argmin(np.abs(record.u - midpoint).sum(axis=1)))
    recordings = []
    for signal in signals:
        u = midpoint + amplitude * np.concatenate([np.zeros(warm_up), signal])[:, None]
        y = np.full(len(u), np.nan)
        y[:warm_up] = record.y[nearest]
        recordings.append(
            Dataset(
                *(u, y, record.dt, record.input_names, record.output_name, record.input_units),
                preprocessing=record.preprocessing,
            )
        )
    return join(tuple(recordings))


def _simulate(model: DynamicModel, record: Dataset, excitations: Dataset) -> Iterator[NDArray[np.float64]]:
    """Yield the model's output in every segment of the excitations, NaN after a divergence."""
    simulated = free_run(model, excitations, bound=find_divergence_bound(record)).y
    for begin, end in excitations.bounds:
        yield simulated[begin + model.maximum_lag : end]


def _evaluate_hold(kind: tuple[float, bool], y: NDArray[np.float64], output_range: float) -> HoldTest:
    """Evaluate the output ``y`` of a hold from the sample at which all lagged inputs are at the level."""
    level, loading = kind
    # After a divergence before the hold, the output is also NaN during the hold.
    bounded = not np.isnan(y).any()
    drift = percent_of_range(y[-1] - y[0], output_range) if bounded else np.inf
    moves = np.ptp(y[len(y) // 2 :]) if bounded else np.inf
    return HoldTest(level, loading, bounded, bool(moves <= RESOLUTION * output_range), drift)


def _evaluate_extreme(level: float, y: NDArray[np.float64], record: Dataset) -> ExtremeTest:
    if np.isnan(y).any():
        return ExtremeTest(level, False, np.inf, np.inf)
    third, last = (float(np.mean(part)) for part in np.array_split(y, 4)[2:])
    low, high = np.nanmin(record.y), np.nanmax(record.y)
    distance = max(0.0, low - y.min(), y.max() - high)
    ranges, drift = (percent_of_range(each, record.output_range) / 100 for each in (distance, last - third))
    return ExtremeTest(level, True, ranges, drift)


def _evaluate_excursion(
    name: str, signal: NDArray[np.float64], y: NDArray[np.float64], output_range: float
) -> ExcursionTest:
    bounded = not np.isnan(y).any()
    if not bounded:
        return ExcursionTest(name, False, np.inf, np.inf)
    # The last two maxima of the input. Two adjacent samples at equal distance from a crest count as one.
    largest = np.flatnonzero(signal >= signal.max() * (1 - 1e-9))
    before, last = largest[np.diff(largest, prepend=-2) > 1][-2:]
    return ExcursionTest(
        name,
        True,
        percent_of_range(y[last] - y[before], output_range),
        percent_of_range(np.ptp(y), output_range),
    )


def percent_of_range(distance: float, output_range: float) -> float:
    """Return a distance in per cent of a range. If the range is 0: 0 for a distance of 0, else infinity."""
    fraction = abs(float(distance)) / output_range if output_range > 0 else np.inf
    return 100 * fraction if distance else 0.0
