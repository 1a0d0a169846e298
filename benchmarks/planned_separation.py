"""Compare planned separations with diagnoses of simulated data.

``python benchmarks/planned_separation.py [SEEDS] [--decisive]`` plans experiments with several simulators,
simulates records with one cause at the misfit of the plan, and diagnoses them. It prints how often a cause is
named, how often causes that the plan calls separable are not among its equivalents, and how often those that
it calls inseparable are. With ``--decisive`` it counts how often a cause is named without the other one of a
pair as its equivalent, on records of the given input and of the decisive one.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.interfaces.simulator import get_tolerances
from islands.discrepancy.planning.cause import CauseScale
from islands.discrepancy.planning.decisive_experiment import design_experiment
from islands.discrepancy.planning.experiment import make_model
from islands.discrepancy.planning.experiment_setup import make_experiment
from islands.discrepancy.planning.isolability import Isolability, find_isolability
from islands.discrepancy.planning.pair_separation import CausePair
from islands.discrepancy.planning.planned_input import find_limits
from islands.discrepancy.planning.response_dictionary import ResponseDictionary
from islands.io.simulator_spec.factory import make_simulator
from islands.systems.signals import sines

ROOT = Path(__file__).resolve().parents[1]

#: Number of records of each cause.
SEEDS = 10

#: Reference misfits, relative to those from which a cause is separable in nine of ten records, that count as
#: separable and as inseparable. At the latter, it is separable in less than one of ten.
SEPARABLE, INSEPARABLE = 1.3, 0.43


@dataclass(frozen=True)
class Planned:
    """An experiment and the causes that are hidden in its records.

    Attributes
    ----------
    spec : str
        Simulation.
    u : ndarray, shape (samples,)
    dt : float
    noise : float
        Noise relative to the standard deviation of the output.
    causes : tuple of str
    """

    spec: str
    u: np.ndarray
    dt: float
    noise: float
    causes: tuple[str, ...]


#: Misfit at which the given input of the motor does not separate the pairs.
LOW = 0.4

#: Noise of the motor's speed, and pairs of causes, for decisive experiments.
NOISE, PAIRS = 0.25, (("cubic-stiffness", "even-nonlinearity"),)

EXPERIMENTS = {
    "dc-motor": Planned(
        f"ode:{ROOT}/examples/simulations/dc-motor.toml",
        sines(0.001, 2.0, (3.0, 1.0), (2.0, 7.3)),
        0.001,
        0.01,
        ("delay", "coulomb-friction", "cubic-stiffness"),
    ),
    "second-order": Planned(
        f"ode:{ROOT}/examples/simulations/second-order.toml",
        sines(0.01, 16.0, (20.0, 12.0), (0.31, 1.37)),
        0.01,
        0.02,
        ("backlash", "dead-zone", "sensor-lag"),
    ),
    "bouc-wen-piezo": Planned(
        "bouc-wen-piezo",
        sines(0.005, 8.0, (60.0, 20.0), (0.5, 1.7)) + 75.0,
        0.005,
        0.003,
        ("exponential-creep", "delay", "linear-drift"),
    ),
}


@dataclass
class Agreement:
    """Counts of records and of pairs of causes."""

    records: int = 0
    named: int = 0
    separable: int = 0
    separated: int = 0
    inseparable: int = 0
    equivalent: int = 0


def compare(planned: Planned, cause: str, seeds: Sequence[int]) -> Agreement:
    """Plan an experiment, hide a cause in simulated records, and diagnose them."""
    record = Dataset(u=planned.u, y=np.full(planned.u.size, np.nan), dt=planned.dt)
    simulator = make_simulator(planned.spec, record)
    prior_std = get_tolerances(simulator)
    quiet = make_experiment(record, simulator, 1.0, prior_std)
    noise = planned.noise * float(np.std(ResponseDictionary(quiet[0]).output))
    experiment, effects = make_experiment(record, simulator, noise, prior_std)
    index = [effect.name for effect in effects].index(cause)
    isolability = find_isolability(experiment, effects)
    row = isolability.rows[index]
    assert row.reference is not None
    dictionary = ResponseDictionary(experiment)
    model = dictionary.get_model(effects[index])
    y = model.output.simulate(model.insert(effects[index], row.reference.values))
    ratios = _rate_by_cause(isolability, index)
    found = Agreement()
    for seed in seeds:
        rng = np.random.default_rng([seed, 41])
        measured = replace(record, y=y + noise * rng.standard_normal(y.size))
        diagnosis = diagnose(measured, make_simulator(planned.spec, measured))
        names = [each for each in diagnosis.effects if each.family != "data"]
        found.records += 1
        if not names:
            continue
        first = names[0]
        listed = {first.name, *first.equivalents}
        found.named += cause.partition(":")[0] in listed
        for other, ratio in ratios.items():
            if ratio > SEPARABLE:
                found.separable += 1
                found.separated += other not in listed
            elif ratio < INSEPARABLE:
                found.inseparable += 1
                found.equivalent += other in listed
    return found


def _rate_by_cause(isolability: Isolability, index: int) -> dict[str, float]:
    """Return the reference misfit relative to the one at which each other cause is separable."""
    row = isolability.rows[index]
    assert row.reference is not None
    ratios: dict[str, float] = {}
    for effect, misfit in zip(isolability.effects, row.misfits, strict=True):
        if effect.cause != isolability.effects[index].cause:
            # The effect of one cause that is the most similar counts.
            ratios[effect.cause] = min(ratios.get(effect.cause, np.inf), row.reference.misfit / misfit)
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
    experiment, effects = make_experiment(record, simulator, NOISE, get_tolerances(simulator))
    dictionary = ResponseDictionary(experiment)
    known = {effect.name: effect for effect in effects}
    causes = [CauseScale(dictionary, known[name]).find_cause(LOW) for name in pair]
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
    given = [each for each in sys.argv[1:] if each != "--decisive"]
    seeds = range(int(given[0]) if given else SEEDS)
    if "--decisive" in sys.argv:
        for pair in PAIRS:
            before, after = count_decided(pair, seeds)
            print(f"{pair[0]} alone named: {before} and {after} of {len(seeds)}", flush=True)
        return
    total: Counter[str] = Counter()
    for name, planned in EXPERIMENTS.items():
        for cause in planned.causes:
            found = vars(compare(planned, cause, seeds))
            total.update(found)
            print(f"{name:16s}{cause:20s}{_describe(found)}", flush=True)
    print(f"{'all':36s}{_describe(total)}")


def _describe(found: dict[str, int] | Counter[str]) -> str:
    return (
        f"named {found['named']}/{found['records']}, separated {found['separated']}/{found['separable']}, "
        f"equivalent {found['equivalent']}/{found['inseparable']}"
    )


if __name__ == "__main__":
    main()
