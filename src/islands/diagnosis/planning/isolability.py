"""Isolability: which causes an experiment can tell apart, and at which strengths.

The expected log-likelihood ratio between a cause and another effect is the squared distance of its whitened
data from the manifold of the other effect's data. Parameters of the other effect
and of the simulation are calibrated within their tolerances.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, log, nan, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.diagnosis.planning.cause import Cause, CauseScale
from islands.diagnosis.planning.experiment import Experiment
from islands.diagnosis.planning.noise_free_fit import NoiseFreeFit, fit_noise_free
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.diagnosis.planning.separation import require_detection, require_separation
from islands.effects.interface.effect import Effect
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback, ignore_progress

#: Misfit in standard deviations of the noise at which expected ratios are reported.
REFERENCE_MISFIT = 1.0

#: Misfits in standard deviations of the noise between which strengths are interpolated.
MISFITS = (0.3, REFERENCE_MISFIT, 3.0, 10.0)

#: Distances that differ from the required one by more than this factor are not fitted, but predicted from
#: that at another misfit.
_MIN_CLEAR_FACTOR = 1.1

#: Misfits that are closer than this factor to the smallest detectable one are left out.
_MIN_STEP = 1.2


@dataclass(frozen=True, slots=True)
class DetectableStrength:
    """The smallest strength of an effect that a diagnosis detects.

    Attributes
    ----------
    misfit : float
        Root mean square that calibration leaves of the response, in standard deviations of the noise.
    misfit_in_output : float
        The same in the unit of the output.
    value, unit : float, str
        Value of the first parameter of the effect, and its unit.
    """

    misfit: float
    misfit_in_output: float
    value: float
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class IsolabilityRow:
    """How far one effect is separable from the others.

    Attributes
    ----------
    detectable : DetectableStrength or None
        None if calibration absorbs the effect at all strengths.
    reference : Cause or None
        The effect at `REFERENCE_MISFIT`, or the strongest one that its bounds allow; None if not detectable.
    misfits : tuple of float
        For each effect, the smallest misfit at which this one is separable from it; infinite if none is, NaN
        for the effect itself.
    ratios : tuple of float
        Expected minus twice log-likelihood ratios of the reference to each effect; NaN for the effect itself.
    """

    detectable: DetectableStrength | None
    reference: Cause | None
    misfits: tuple[float, ...]
    ratios: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Isolability:
    """Which causes an experiment can tell apart.

    Attributes
    ----------
    effects : tuple of Effect
    rows : tuple of IsolabilityRow
        One for each effect.
    """

    effects: tuple[Effect, ...]
    rows: tuple[IsolabilityRow, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def misfits(self) -> NDArray[np.float64]:
        """Smallest misfit at which the cause of a row is separable from that of a column, in noise stds."""
        return np.array([row.misfits for row in self.rows])

    @property
    def undetectable(self) -> tuple[str, ...]:
        """Names of the effects that calibration absorbs."""
        return tuple(e.name for e, row in zip(self.effects, self.rows, strict=True) if row.detectable is None)

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Groups of detectable causes, no two of which are separable in either direction (complete linkage).

        Groups of one cause are left out.
        """
        kept = [index for index, row in enumerate(self.rows) if row.detectable is not None]
        if len(kept) < 2:
            return ()
        misfits = self.misfits[np.ix_(kept, kept)]
        is_separable = np.isfinite(np.minimum(misfits, misfits.T)).astype(float)
        np.fill_diagonal(is_separable, 0.0)
        distances = scipy.spatial.distance.squareform(is_separable)
        tree = scipy.cluster.hierarchy.linkage(distances, "complete")
        labels = scipy.cluster.hierarchy.fcluster(tree, 0.5, "distance")
        groups = (
            tuple(self.names[kept[place]] for place in np.flatnonzero(labels == label))
            for label in dict.fromkeys(labels.tolist())
        )
        return tuple(group for group in groups if len(group) > 1)


def find_isolability(
    experiment: Experiment,
    effects: Sequence[Effect],
    parallel_map: ParallelMap = map,
    progress: ProgressCallback = ignore_progress,
) -> Isolability:
    """Find which effects an experiment can tell apart.

    Parameters
    ----------
    experiment : Experiment
    effects : sequence of Effect
        Effects that a diagnosis would search for.
    parallel_map : ParallelMap
        Compares each effect with all others.
    progress : ProgressCallback
        Takes a message with the number of effects that have been compared, and their fraction.
    """
    rows = []
    for row in parallel_map(_RowFinder(experiment, tuple(effects)), range(len(effects))):
        rows.append(row)
        progress(f"{len(rows)} of {len(effects)} causes", len(rows) / len(effects))
    return Isolability(tuple(effects), tuple(rows))


@dataclass(frozen=True, slots=True, eq=False)
class _RowFinder:
    """Function that compares one effect, given by its index, with all others."""

    experiment: Experiment
    effects: tuple[Effect, ...]
    _made: list[ResponseDictionary] = field(init=False, default_factory=list)

    def __call__(self, index: int) -> IsolabilityRow:
        if not self._made:
            self._made.append(ResponseDictionary(self.experiment))
        dictionary, effect = self._made[0], self.effects[index]
        scale = CauseScale(dictionary, effect)
        required = require_detection(self.experiment, effect, len(self.effects))
        smallest = required / sqrt(self.experiment.estimation_samples)
        weakest = scale.find_cause(smallest, is_whitened=True)
        nothing = (nan,) * len(self.effects)
        if weakest is None:
            return IsolabilityRow(None, None, nothing, nothing)
        least = smallest * (weakest.misfit / weakest.whitened_misfit)
        wanted = [misfit for misfit in MISFITS if misfit > _MIN_STEP * least]
        found = (scale.find_cause(misfit) for misfit in wanted)
        causes = [weakest]
        causes += [cause for cause in found if cause is not None and cause.misfit > causes[-1].misfit]
        parameter = effect.parameters(self.experiment.context)[0]
        detectable = DetectableStrength(
            weakest.misfit, weakest.misfit * self.experiment.noise.std, weakest.values[0], parameter.unit
        )
        reference = min(
            range(len(causes)), key=lambda place: abs(log(causes[place].misfit / REFERENCE_MISFIT))
        )
        pairs = [
            (nan, nan) if other is effect else PairSearch(dictionary, causes, other, reference).find()
            for other in self.effects
        ]
        misfits, ratios = zip(*pairs, strict=True)
        return IsolabilityRow(detectable, causes[reference], misfits, ratios)


class PairSearch:
    """Search for the smallest misfit at which a cause is separable from another effect.

    Parameters
    ----------
    dictionary : ResponseDictionary
    causes : sequence of Cause
        One cause at increasing misfits.
    other : Effect
    reference : int
        Index of the cause whose expected ratio is reported.
    """

    def __init__(
        self, dictionary: ResponseDictionary, causes: Sequence[Cause], other: Effect, reference: int
    ) -> None:
        self._dictionary, self._causes, self._other, self._reference = dictionary, causes, other, reference
        self._required = require_separation(dictionary.experiment, causes[0].effect, other)
        self._fits: dict[int, NoiseFreeFit] = {}

    def find(self) -> tuple[float, float]:
        """Return the misfit in standard deviations of the noise, and the expected ratio of the reference."""
        ratio = self._fit_distance(self._reference) ** 2
        # Index of the strongest cause known to be inseparable, and of the weakest known to be separable.
        low, high = -1, len(self._causes)
        middle = self._reference
        while high - low > 1:
            if self._is_separable(middle):
                high = middle
            else:
                low = middle
            middle = (low + high) // 2
        if high == len(self._causes):
            return inf, ratio
        if high == 0:
            return self._causes[0].misfit, ratio
        return self._interpolate(low, high), ratio

    def _is_separable(self, place: int) -> bool:
        """Return whether a cause is separable; fit it only if its distance might be the required one."""
        distance = self._predict_distance(place)
        if place not in self._fits and abs(log(max(distance, 1e-12) / max(self._required, 1e-12))) < log(
            _MIN_CLEAR_FACTOR
        ):
            distance = self._fit_distance(place)
        return distance >= self._required

    def _predict_distance(self, place: int) -> float:
        """Return the distance of a cause, in proportion to its misfit and to the nearest fitted distance."""
        near = min(self._fits, key=lambda fitted: abs(fitted - place))
        return self._fit_distance(near) * self._causes[place].misfit / self._causes[near].misfit

    def _fit_distance(self, place: int) -> float:
        if place not in self._fits:
            observed = self._causes[place].observed
            starts = self._dictionary.find_starts(self._other, observed)
            starts += [fit.values for near, fit in self._fits.items() if abs(near - place) == 1]
            model = self._dictionary.get_model(self._other)
            self._fits[place] = fit_noise_free(model, observed, starts or [model.output.nominal])
        # An effect that explains nothing is as far away as the simulation without it.
        cause = self._causes[place]
        without = cause.whitened_misfit * sqrt(self._dictionary.experiment.estimation_samples)
        return min(sqrt(self._fits[place].squared_distance), without)

    def _interpolate(self, low: int, high: int) -> float:
        """Interpolate the misfit between two causes; distances grow about in proportion to it."""
        near, far = (log(max(self._predict_distance(place), 1e-12)) for place in (low, high))
        below, above = (log(self._causes[place].misfit) for place in (low, high))
        share = (log(self._required) - near) / (far - near)
        return float(np.exp(below + share * (above - below)))
