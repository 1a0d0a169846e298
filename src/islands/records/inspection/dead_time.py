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
        _describe(record, place, weighed[place]) if place in weighed else _describe_silence(record, place)
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


def _describe_silence(record: Dataset, place: int) -> Fact:
    name, output = record.input_names[place], record.output_name
    return _make_fact(
        name, None, None, None, f"No lag of {name} is visible at which {output} begins to respond."
    )


def _make_fact(
    name: str, value: float | None, interval: tuple[float, float] | None, right: float | None, sentence: str
) -> Fact:
    return Fact("dead-time", name, value, "samples", interval, right, sentence)


def _describe(record: Dataset, place: int, found: LagProbabilities | None) -> Fact:
    name = record.input_names[place]
    if found is None:
        text = f"The record is too short to tell the dead time of {name}."
        return _make_fact(name, None, None, None, text)
    if not found.is_visible:
        return _describe_silence(record, place)
    low, high = found.interval
    interval = (float(low), float(high))
    within = np.convolve(found.values, np.ones(3), "same")
    # Of lags that are equally probable within one sample, the most probable one.
    place_of_value = int(np.argmax(within + 1e-3 * found.values))
    value, right = found.first + place_of_value, min(float(within[place_of_value]), 1.0)
    response = f"{record.output_name} responds to {name}"
    between = f"between {low} and {_count(high)}" if low < high else ""
    if right < _LEAST_PROBABILITY:
        text = f"It is uncertain when {response}: {between} with a probability of 95 %."
        return _make_fact(name, None, interval, None, text)
    after = f"after {_count(value)} ({value * record.dt:.4g} s)" if value else "within the sample"
    range_ = f", {between} with a probability of 95 %" if between else ""
    chance = f"right within one sample with a probability of {_state_percentage(right)}."
    return _make_fact(name, float(value), interval, right, f"{response} {after}{range_}; {chance}")


def _state_percentage(share: float) -> str:
    """Return a probability; one that is nearly certain is not stated as certain."""
    return "more than 99 %" if share > 0.99 else f"{100.0 * share:.0f} %"


def _count(samples: int) -> str:
    return f"{samples} sample" if samples == 1 else f"{samples} samples"
