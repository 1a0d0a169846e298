"""Plans of experiments as ``plan.json``, and next experiments as a part of ``discrepancy.json``."""

from collections.abc import Iterable
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from islands.diagnosis.planning.alternative_experiments import AlternativeExperiment, choose_cheapest
from islands.diagnosis.planning.channel_noise import ChannelNoise
from islands.diagnosis.planning.decisive_experiment import DecisiveExperiment
from islands.diagnosis.planning.experiment_plan import ExperimentPlan
from islands.diagnosis.planning.isolability import IsolabilityRow
from islands.diagnosis.planning.next_experiment import DesignedInput, NextExperiment, SeparatedPair
from islands.diagnosis.planning.pair_separation import PairSeparation
from islands.diagnosis.planning.planned_input import InputLimits
from islands.effects.catalogue import get_title
from islands.report.documents.result_folder import record_document
from islands.sentences import write_one

SCHEMA = "islands.plan/1"

#: File of the designed input in the folder of a diagnosis.
NEXT_EXPERIMENT_FILE = "next-experiment.csv"


def plan_document(plan: ExperimentPlan) -> dict[str, Any]:
    """Return a plan as a JSON document.

    Misfits are in standard deviations of the noise, and distances in those of its innovations. Misfits that
    are not reached, and entries of a cause with itself, are None.
    """
    isolability = plan.isolability
    cheapest = choose_cheapest(plan.alternatives)
    return {
        "schema": SCHEMA,
        "record": record_document(plan.record),
        "simulation": plan.simulation,
        "noise_std": plan.noise_std,
        "noise": _describe_noise(plan.noise, plan.record.dt),
        "causes": [
            {"name": name, "family": effect.family, **_describe_row(row)}
            for name, effect, row in zip(
                isolability.names, isolability.effects, isolability.rows, strict=True
            )
        ],
        "separable_from_misfit": [_finite(row.misfits) for row in isolability.rows],
        "expected_log_likelihood_ratio": [_finite(row.ratios) for row in isolability.rows],
        "inseparable_groups": [list(group) for group in isolability.groups],
        "undetectable": list(isolability.undetectable),
        "pair": list(plan.pair),
        "alternatives": [_describe_alternative(each) for each in plan.alternatives],
        "cheapest_alternative": None if cheapest is None else cheapest.change,
        "left_out": list(plan.left_out),
        "decisive_experiment": None if plan.decisive is None else _describe_decisive(plan.decisive),
    }


def _describe_noise(noise: ChannelNoise, dt: float) -> dict[str, Any]:
    return {
        "origin": str(noise.origin),
        "is_white": noise.is_white,
        "autoregression": noise.model.coefficients.tolist(),
        "innovation_std": float(np.sqrt(noise.model.variance)),
        "time_constant_s": dt * noise.time_constant,
    }


def _describe_row(row: IsolabilityRow) -> dict[str, Any]:
    reference = row.reference
    return {
        "detectable": None if row.detectable is None else asdict(row.detectable),
        "reference_misfit": None if reference is None else reference.misfit,
        "reference_values": None if reference is None else list(reference.values),
    }


def _finite(numbers: Iterable[float]) -> list[float | None]:
    return [number if isfinite(number) else None for number in numbers]


def describe_separation(separation: PairSeparation) -> dict[str, Any]:
    """Return the separation of a pair of causes as a JSON document."""
    return {
        "distance": separation.distance,
        "required_distance": separation.required,
        "expected_log_likelihood_ratio": separation.expected_ratio,
        "is_sufficient": separation.sufficiency >= 1.0,
    }


def _describe_alternative(each: AlternativeExperiment) -> dict[str, Any]:
    return {
        "change": each.change,
        "cost": each.cost.name.lower(),
        "amplitude": each.amplitude,
        "rate": each.rate,
        "duration_s": each.duration,
        **describe_separation(each.separation),
    }


def _describe_decisive(decisive: DecisiveExperiment) -> dict[str, Any]:
    return {
        "input": decisive.description,
        "samples": decisive.u.size,
        "dt": decisive.dt,
        "pairs": [
            {
                "causes": list(pair.names),
                "given": describe_separation(before),
                "decisive": describe_separation(after),
            }
            for pair, before, after in zip(decisive.pairs, decisive.before, decisive.after, strict=True)
        ],
    }


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
    document = describe_next_experiment(experiment)
    designed = document["input"] or {}
    excesses = (("range", designed.get("range_excess", 0.0)), ("rate", designed.get("rate_excess", 0.0)))
    pairs = [
        {**pair, "labels": list(map(_label, pair["causes"])), "is_repeated": (pair["repeats"] or 0) > 1}
        for pair in document["pairs"]
        if pair["recorded"] is None or not pair["recorded"]["is_sufficient"]
    ]
    return write_one(
        "plan",
        "advice",
        input=designed,
        pairs=pairs,
        excesses=[(name, factor) for name, factor in excesses if factor > 1.0],
    )


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


def _label(name: str) -> str:
    title = get_title(name)
    return f"{title} (`{name}`)" if title else name
