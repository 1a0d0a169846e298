"""All facts about a record, with a bound on the samples that they are measured on."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from islands.progress import Failure, attempt
from islands.records.dataset import Dataset
from islands.records.inspection.channel import Channel, channels
from islands.records.inspection.dead_time import estimate_dead_times
from islands.records.inspection.drift import measure_drift
from islands.records.inspection.excitation import measure_excitation
from islands.records.inspection.fact import Fact
from islands.records.inspection.feedback import find_feedback
from islands.records.inspection.loop import check_loop
from islands.records.inspection.noise import measure_noise
from islands.records.inspection.oversampling import recommend_rate
from islands.records.inspection.quantisation import find_quantisation
from islands.records.inspection.rest import check_rest
from islands.records.inspection.saturation import find_saturation
from islands.records.missing_outputs import skip_missing_outputs

#: Most samples, and most inputs, that the facts are measured on.
MOST_SAMPLES, MOST_INPUTS = 100_000, 16

#: Names of the facts, in their order.
FACTS = (
    *("samples", "quantisation", "saturation", "noise", "band", "levels", "coverage", "excitation-order"),
    *("dead-time", "feedback", "rest", "loop", "drift", "sampling-time"),
)


@dataclass(frozen=True, slots=True)
class RecordFacts:
    """Facts about a record.

    Attributes
    ----------
    facts : tuple of Fact
        In the order of `FACTS`; facts about several signals in the order of the record.
    """

    facts: tuple[Fact, ...]

    def find(self, name: str, signal: str | None = None) -> Fact:
        """Return the fact of a name, about a signal if several have it.

        Raises
        ------
        KeyError
            There is no such fact.
        """
        for fact in self.facts:
            if fact.name == name and signal in (None, fact.signal):
                return fact
        raise KeyError(name if signal is None else (name, signal))


def measure_facts(record: Dataset) -> RecordFacts:
    """Measure all facts about a record.

    A fact that fails is unknown, and its sentence states the reason, so that the others remain. Missing
    outputs are skipped. Of a record with more than `MOST_SAMPLES` samples, the middle is taken; the
    fact ``samples`` says so. The drift is always that of the whole record.

    Parameters
    ----------
    record : Dataset

    Raises
    ------
    RecordError
        Every output is missing.
    """
    complete = skip_missing_outputs(record)
    first = max(0, complete.samples - MOST_SAMPLES) // 2
    part = complete[first : first + MOST_SAMPLES] if complete.samples > MOST_SAMPLES else complete
    # Statistics of very large numbers overflow: their facts are then unknown.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = [_count_samples(record, complete, part, first)]
        for channel in channels(part):
            found += _measure("quantisation", channel.name, partial(_describe_channel, channel, part))
        varying = [place for place in range(min(part.inputs, MOST_INPUTS)) if np.ptp(part.u[:, place]) > 0.0]
        found += _measure("dead-time", "", partial(estimate_dead_times, part, varying))
        found += _measure("feedback", "", lambda: [find_feedback(part)])
        found += _measure("rest", "", lambda: [check_rest(part)])
        found += _measure("loop", "", lambda: [check_loop(part, place) for place in varying])
        found += _measure("drift", "", lambda: [measure_drift(complete)])
        found += _measure("sampling-time", "", lambda: [recommend_rate(part)])
    return RecordFacts(tuple(sorted(found, key=lambda fact: FACTS.index(fact.name))))


def _measure(name: str, signal: str, measure: Callable[[], Iterable[Fact]]) -> list[Fact]:
    """Return the facts that a function measures; an unknown one of a name if it fails."""
    found = attempt(lambda: list(measure()))
    if isinstance(found, Failure):
        return [Fact(name, signal, "not_computed", details={"reason": found.reason})]
    return found


def _count_samples(record: Dataset, complete: Dataset, part: Dataset, first: int) -> Fact:
    details = {
        "samples": record.samples,
        "dt": record.dt,
        "seconds": record.samples * record.dt,
        "output": record.output_name,
        "missing": record.samples - complete.samples,
        "part": None if part is complete else (first, first + part.samples - 1),
    }
    return Fact("samples", "", "samples", float(record.samples), details=details)


def _describe_channel(channel: Channel, record: Dataset) -> list[Fact]:
    quantisation = find_quantisation(channel)
    found = [quantisation, find_saturation(channel, quantisation)]
    if np.ptp(channel.values) == 0.0:
        return found
    excitation = () if channel.is_output else measure_excitation(channel, record)
    # An input with a few levels has no noise: it is a set point.
    if not any(fact.name == "levels" and fact.value is not None for fact in excitation):
        found.append(measure_noise(channel, record, quantisation))
    return [*found, *excitation]
