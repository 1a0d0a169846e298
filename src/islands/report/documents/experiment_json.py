"""Next experiment of a diagnosis as a part of ``discrepancy.json``, and in words."""

from typing import Any

from islands.diagnosis.planning.next_experiment import (
    DesignedInput,
    NextExperiment,
    SeparatedPair,
)
from islands.diagnosis.planning.planned_input import InputLimits
from islands.effects.catalogue import get_title
from islands.report.documents.plan_json import describe_separation

#: File of the designed input in the folder of a diagnosis.
NEXT_EXPERIMENT_FILE = "next-experiment.csv"

_NO_INPUT = "no input of these forms separates them; measure a signal between the places where they act"

_UNKNOWN_INPUT = (
    "the simulation depends on this record, of which it is a column or which its states follow, so that no "
    "other input can be compared; measure a signal between the places where they act"
)


def describe_next_experiment(experiment: NextExperiment) -> dict[str, Any]:
    """Return the next experiment as a JSON document, without the samples of its input."""
    designed = get_suggested_input(experiment)
    return {
        "pairs": [_describe_pair(each) for each in experiment.pairs],
        "input": None if designed is None else _describe_input(designed),
    }


def get_suggested_input(experiment: NextExperiment) -> DesignedInput | None:
    """Return the designed input; None if there is none, or if the record separates all pairs already."""
    return None if all(map(_is_separated, experiment.pairs)) else experiment.input


def write_advice(experiment: NextExperiment) -> str:
    """Describe the next experiment in words: its input, and the separation of each pair.

    The text is empty if the record separates all pairs already: their causes have similar scores since both
    imitate another one.
    """
    pairs = "; ".join(_write_pair(each) for each in experiment.pairs if not _is_separated(each))
    designed = get_suggested_input(experiment)
    return pairs if designed is None else f"{_write_input(designed)}: {pairs}"


def _is_separated(pair: SeparatedPair) -> bool:
    """Return whether the record separates the causes, although their scores are similar."""
    return pair.recorded is not None and pair.recorded.sufficiency >= 1.0


def _describe_pair(pair: SeparatedPair) -> dict[str, Any]:
    return {
        "causes": list(pair.causes),
        "recorded": None if pair.recorded is None else describe_separation(pair.recorded),
        "predicted": None if pair.predicted is None else describe_separation(pair.predicted),
        "repeats": pair.repeats,
    }


def _describe_input(designed: DesignedInput) -> dict[str, Any]:
    range_excess, rate_excess = designed.excess
    return {
        "description": designed.description,
        "name": designed.name,
        "unit": designed.unit,
        "samples": designed.u.size,
        "dt": designed.dt,
        "limits": _describe_limits(designed.limits),
        "recorded_limits": _describe_limits(designed.recorded),
        "is_within_record": designed.is_within,
        "range_excess": range_excess,
        "rate_excess": rate_excess,
        "file": NEXT_EXPERIMENT_FILE,
    }


def _describe_limits(limits: InputLimits) -> dict[str, float]:
    return {"lower": limits.lower, "upper": limits.upper, "rate": limits.rate}


def _write_input(designed: DesignedInput) -> str:
    played = f"{designed.description}, for {designed.duration:.3g} s"
    if designed.is_within:
        return f"{played}, within the range and the rate of the record"
    excesses = zip(("range", "rate"), designed.excess, strict=True)
    factors = " and ".join(f"a {name} {factor:.3g} times that" for name, factor in excesses if factor > 1.0)
    return f"{played}, with {factors} of the record, since no input within it separates as many causes"


def _label(name: str) -> str:
    title = get_title(name)
    return f"{title} (`{name}`)" if title else name


def _write_pair(pair: SeparatedPair) -> str:
    names = " and ".join(map(_label, pair.causes))
    if pair.recorded is None:
        return f"{names}: {_UNKNOWN_INPUT}"
    apart = f"{names} are {pair.recorded.distance:.1f} standard deviations of the noise apart in this record"
    if pair.predicted is None or pair.repeats is None:
        return f"{apart}, and {pair.recorded.required:.1f} are needed; {_NO_INPUT}"
    runs = f", which takes {pair.repeats} runs" if pair.repeats > 1 else ""
    needed = f"{pair.predicted.required:.1f} are needed{runs}"
    return f"{apart}, {pair.predicted.distance:.1f} in that one, and {needed}"
