"""Dead times between the inputs and the output, with their probabilities.

The lags are compared at the rate of the record. Means of several samples locate longer ones first. See
`islands.records.inspection.lag_comparison`.
"""

from collections.abc import Sequence

import numpy as np

from islands.records.averaging import average_samples
from islands.records.dataset import Dataset
from islands.records.inspection.fact import Fact
from islands.records.inspection.lag_comparison import TOGETHER, LagProbabilities, weigh_lags
from islands.records.missing_outputs import skip_missing_outputs

#: Means of this many samples locate lags that are longer than `LARGEST`.
_COARSE = (4, 16)

#: Probability from which on a lag is stated as one value.
_LEAST_PROBABILITY = 0.5

#: Probability that is not stated as a number, since none is certain.
_ALMOST_CERTAIN = 0.99


def estimate_dead_times(record: Dataset, places: Sequence[int]) -> list[Fact]:
    """Estimate how many samples after its inputs the output begins to respond.

    The value is the smallest lag d of the input, u(k-d), to which y(k) responds. It is 1 for a system
    without dead time with an input that is held between two samples, and 0 if the output responds within the
    sample. Correlated inputs are judged together.

    Parameters
    ----------
    record : Dataset
        Rows with a missing output are left out.
    places : sequence of int
        Indices of inputs, from 0.

    Returns
    -------
    list of Fact
        The confidence is the probability that the value is right within one sample. The value is None if that
        is improbable: the interval then tells what is known. It is None, too, if the record is too short or
        no response is visible.
    """
    record = skip_missing_outputs(record)
    varying = [place for place in places if np.ptp(record.u[:, place]) > 0.0 and np.ptp(record.y) > 0.0]
    weighed: dict[int, LagProbabilities | None] = {}
    for group in _group(record, varying):
        weighed |= dict(zip(group, _weigh(record, group), strict=True))
    return [
        _describe(record, place, weighed[place]) if place in weighed else _make_fact(record, place, "silent")
        for place in places
    ]


def _group(record: Dataset, places: Sequence[int]) -> list[list[int]]:
    """Return groups of at most `TOGETHER` inputs, each of one input and those that it is correlated with."""
    left, groups = list(places), []
    if len(left) <= TOGETHER:
        return [left] if left else []
    correlation = dict(zip(left, np.abs(np.corrcoef(record.u.T[left])), strict=True))
    while left:
        near = dict(zip(places, correlation[left[0]], strict=True))
        group = sorted(left, key=lambda place: (place != left[0], -near[place]))[:TOGETHER]
        groups.append(group)
        left = [place for place in left if place not in group]
    return groups


def _weigh(record: Dataset, group: Sequence[int]) -> Sequence[LagProbabilities | None]:
    """Return the probabilities of the lags, after a comparison of coarser records for long lags."""
    found = weigh_lags(record, group, [0] * len(group))
    if found is None:
        return [None] * len(group)
    for count in _COARSE:
        if not any(each.may_be_later for each in found) or max(record.segments) < count:
            break
        coarse = weigh_lags(average_samples(record, count), group, [0] * len(group))
        if coarse is None:
            break
        smallest = [
            max(0, count * (rough.interval[0] - 2)) if each.may_be_later else 0
            for each, rough in zip(found, coarse, strict=True)
        ]
        found = weigh_lags(record, group, smallest) or found
    return found


def _make_fact(
    record: Dataset,
    place: int,
    finding: str,
    value: float | None = None,
    found: LagProbabilities | None = None,
    right: float | None = None,
) -> Fact:
    interval = None if found is None else (float(found.interval[0]), float(found.interval[1]))
    details = {
        "output": record.output_name,
        "dt": record.dt,
        "is_interval": interval is not None and interval[0] < interval[1],
        "is_certain": right is not None and right > _ALMOST_CERTAIN,
    }
    name = record.input_names[place]
    return Fact("dead-time", name, f"dead_time_{finding}", value, "samples", interval, right, details)


def _describe(record: Dataset, place: int, found: LagProbabilities | None) -> Fact:
    if found is None:
        return _make_fact(record, place, "short")
    if not found.is_visible:
        return _make_fact(record, place, "silent")
    within = np.convolve(found.values, np.ones(3), "same")
    # Of lags that are equally probable within one sample, the most probable one.
    place_of_value = int(np.argmax(within + 1e-3 * found.values))
    value, right = found.first + place_of_value, min(float(within[place_of_value]), 1.0)
    if right < _LEAST_PROBABILITY:
        return _make_fact(record, place, "uncertain", None, found)
    return _make_fact(record, place, "known", float(value), found, right)
