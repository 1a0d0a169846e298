"""Compare planned separations with diagnoses of simulated data.

``python -m lab.diagnosis.planned_separation [--seeds N] [--noise KIND] [--weakest | --decisive]`` plans
experiments with several simulators, simulates records with one cause at the misfit of the plan, and diagnoses
them. It prints how often a cause is named, how often causes that the plan calls separable are not among its
equivalents, and how often those that it calls inseparable are.

With ``--noise`` the noise is of another kind than white: it is measured in one record without a cause, and
the same is printed for a plan with white noise of the same standard deviation. With ``--weakest`` each cause
has the smallest detectable misfit of a plan. With ``--decisive`` it counts how often a cause is named without
the other one of a pair as its equivalent, on records of the given input and of the decisive one.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.planning.cause import CauseScale
from islands.diagnosis.planning.decisive_experiment import design_experiment
from islands.diagnosis.planning.experiment import make_model
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.diagnosis.planning.isolability import Isolability, find_isolability
from islands.diagnosis.planning.pair_separation import CausePair
from islands.diagnosis.planning.planned_input import find_limits
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.diagnosis.planning.separation import require_detection
from islands.diagnosis.procedure import diagnose
from islands.records.dataset import Dataset
from islands.simulators.specification.factory import make_simulator
from lab.diagnosis.injection.noise import NOISES
from lab.diagnosis.planned_experiments import EXPERIMENTS, Planned, make_plans

#: Number of records of each cause.
SEEDS = 10

#: Reference misfits, relative to those from which a cause is separable in nine of ten records, that count as
#: separable and as inseparable. At the latter, it is separable in less than one of ten.
SEPARABLE, INSEPARABLE = 1.3, 0.43

#: Misfit at which the given input of the motor does not separate the pairs.
LOW = 0.4

#: Noise of the motor's speed, and pairs of causes, for decisive experiments.
NOISE, PAIRS = 0.25, (("cubic-stiffness", "even-nonlinearity"),)


@dataclass
class Agreement:
    """Counts of records and of pairs of causes."""

    records: int = 0
    named: int = 0
    separable: int = 0
    separated: int = 0
    inseparable: int = 0
    equivalent: int = 0


def compare(planned: Planned, kind: str, seeds: Sequence[int]) -> Iterator[tuple[str, str, Agreement]]:
    """Hide causes at the reference misfit in simulated records, and diagnose them.

    Yields
    ------
    str, str, Agreement
        Name of the cause, and noise of the plan.
    """
    plans = make_plans(planned, kind)
    found = {name: find_isolability(each, plans.effects) for name, each in plans.experiments.items()}
    names = [effect.name for effect in plans.effects]
    for cause in planned.causes:
        index = names.index(cause)
        effect, reference = plans.effects[index], next(iter(found.values())).rows[index].reference
        assert reference is not None
        listed = plans.diagnose(effect, reference.values, seeds)
        for name, isolability in found.items():
            scale = CauseScale(ResponseDictionary(plans.experiments[name]), effect)
            same = scale.make_cause(reference.values)
            assert same is not None
            ratios = _rate_by_cause(isolability, index, same.misfit)
            yield cause, name, _count(cause.partition(":")[0], listed, ratios)


def detect_weakest(
    planned: Planned, kind: str, seeds: Sequence[int]
) -> Iterator[tuple[str, str, float, int]]:
    """Hide causes at the smallest detectable misfit of each plan, and diagnose them.

    Yields
    ------
    str, str, float, int
        Name of the cause, noise of the plan, misfit in standard deviations of the noise, and the number of
        records in which anything is named.
    """
    plans = make_plans(planned, kind)
    for effect in plans.effects:
        if effect.name not in planned.causes:
            continue
        for name, experiment in plans.experiments.items():
            required = require_detection(experiment, effect, len(plans.effects))
            scale = CauseScale(ResponseDictionary(experiment), effect)
            weakest = scale.find_cause(required / experiment.estimation_samples**0.5, is_whitened=True)
            assert weakest is not None
            listed = plans.diagnose(effect, weakest.values, seeds)
            yield effect.name, name, weakest.misfit, sum(map(bool, listed))


def _count(cause: str, listed: Sequence[set[str]], ratios: dict[str, float]) -> Agreement:
    found = Agreement(len(listed))
    for names in filter(None, listed):
        found.named += cause in names
        for other, ratio in ratios.items():
            if ratio > SEPARABLE:
                found.separable += 1
                found.separated += other not in names
            elif ratio < INSEPARABLE:
                found.inseparable += 1
                found.equivalent += other in names
    return found


def _rate_by_cause(isolability: Isolability, index: int, misfit: float) -> dict[str, float]:
    """Return the misfit relative to the one at which each other cause is separable."""
    ratios: dict[str, float] = {}
    for effect, smallest in zip(isolability.effects, isolability.rows[index].misfits, strict=True):
        if effect.cause != isolability.effects[index].cause:
            # The effect of one cause that is the most similar counts.
            ratios[effect.cause] = min(ratios.get(effect.cause, np.inf), misfit / smallest)
    return ratios


def count_decided(pair: tuple[str, str], seeds: Sequence[int]) -> tuple[int, int]:
    """Hide the first cause of a pair in a motor, with the misfit `LOW` for the given input, and diagnose.

    Returns
    -------
    int, int
        Number of records in which it alone is named, with the given input and with the decisive one.
    """
    planned = EXPERIMENTS["dc-motor"]
    record = Dataset(u=planned.u, y=np.full(planned.u.size, np.nan), dt=planned.dt)
    simulator = make_simulator(planned.spec, record)
    experiment, effects = make_experiment(record, simulator, NOISE, simulator.tolerances)
    dictionary = ResponseDictionary(experiment)
    known = {effect.name: effect for effect in effects}
    found = [CauseScale(dictionary, known[name]).find_cause(LOW) for name in pair]
    causes = [each for each in found if each is not None]
    limits = replace(find_limits(planned.u, planned.dt), rate=100.0)
    decisive = design_experiment(experiment, [CausePair(*causes)], limits, planned.u.size)
    print(f"{' or '.join(pair)}: {decisive.description}, {decisive.before} to {decisive.after}", flush=True)
    counts = []
    for u in (planned.u, decisive.u):
        model = make_model(experiment.with_input(u), known[pair[0]])
        y = model.output.simulate(model.insert(known[pair[0]], causes[0].values))
        counts.append(sum(_is_decided(planned, u, y, pair, seed) for seed in seeds))
    return counts[0], counts[1]


def _is_decided(planned: Planned, u: np.ndarray, y: np.ndarray, pair: tuple[str, str], seed: int) -> bool:
    measured = Dataset(
        u=u, y=y + NOISE * np.random.default_rng([seed, 43]).standard_normal(y.size), dt=planned.dt
    )
    found = diagnose(measured, make_simulator(planned.spec, measured)).effects
    return bool(found) and found[0].name == pair[0] and pair[1] not in found[0].equivalents


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--noise", choices=tuple(NOISES), default="white")
    parser.add_argument("--weakest", action="store_true")
    parser.add_argument("--decisive", action="store_true")
    given = parser.parse_args()
    seeds = range(given.seeds)
    if given.decisive:
        for pair in PAIRS:
            before, after = count_decided(pair, seeds)
            print(f"{pair[0]} alone named: {before} and {after} of {len(seeds)}", flush=True)
        return
    if given.weakest:
        _print_weakest(given.noise, seeds)
        return
    totals: dict[str, Counter[str]] = {}
    for name, planned in EXPERIMENTS.items():
        for cause, plan, agreement in compare(planned, given.noise, seeds):
            found = vars(agreement)
            totals.setdefault(plan, Counter()).update(found)
            print(f"{name:16s}{cause:20s}plan with {plan} noise: {_describe(found)}", flush=True)
    for plan, total in totals.items():
        print(f"{'all':36s}plan with {plan} noise: {_describe(total)}")


def _print_weakest(kind: str, seeds: Sequence[int]) -> None:
    totals: Counter[str] = Counter()
    records: Counter[str] = Counter()
    for name, planned in EXPERIMENTS.items():
        for cause, plan, misfit, detected in detect_weakest(planned, kind, seeds):
            totals[plan] += detected
            records[plan] += len(seeds)
            where = f"{name:16s}{cause:20s}plan with {plan} noise:"
            print(f"{where} {misfit:.2f} sigma, detected {detected}/{len(seeds)}", flush=True)
    for plan, total in totals.items():
        print(f"{'all':36s}plan with {plan} noise: detected {total}/{records[plan]}")


def _describe(found: dict[str, int] | Counter[str]) -> str:
    return (
        f"named {found['named']}/{found['records']}, separated {found['separated']}/{found['separable']}, "
        f"equivalent {found['equivalent']}/{found['inseparable']}"
    )


if __name__ == "__main__":
    main()
