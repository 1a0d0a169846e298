"""What is measured: a record, and three kinds of individuals on it.

``poly`` are products of lagged signals, ``general`` random trees, ``gp`` individuals of a real run. All are
drawn from fixed seeds; a hash of their text tells whether two benchmarks measured the same.
"""

import hashlib
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

from islands.data.dataset import Dataset
from islands.errors import ModelError
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual, Population
from islands.evolution.island import first_generation, step
from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands.model.expression import Apply, Constant, Expression, Lagged
from islands.model.model import canonical_order
from islands.model.primitives import MUL, SIGN, SUB
from islands.model.regressor import Regressor, regressor
from islands.systems.catalogue import make_record

#: The paper's case 1: what is searched, and how.
CASE1 = PRESETS["paper-case1"]

#: Samples before the first row, and of a shooting interval.
WARM_UP, INTERVAL = CASE1.maximum_lag, CASE1.shooting

#: Samples of the record.
SAMPLES = 100_000

#: Terms of an individual of the two drawn kinds, and their deepest lag.
TERMS, DEEPEST = 10, 25

#: The paper's population of 500, on two islands.
ISLANDS = 2
ISLAND = replace(CASE1, population=CASE1.population // ISLANDS)


@dataclass(frozen=True, slots=True)
class WorkloadModel:
    """A model to evaluate.

    Attributes
    ----------
    regressors : tuple of Regressor
        In canonical order.
    theta : tuple of float
        Parameters with which it stays bounded on the record, so that every simulation runs to its end.
    constraints : str
        An entry of the parameter constraints, under which our side estimates them anew.
    """

    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    constraints: str


def benchmark_record(samples: int = SAMPLES) -> Dataset:
    """Return the first samples of the piezo's record, in units of three times its spread.

    So scaled, products of many factors keep their size.
    """
    whole = make_record("bouc-wen-piezo", "consistent", "estimation")
    scaled = Dataset(whole.u / (3 * whole.u.std()), whole.y / (3 * whole.y.std()), whole.dt)
    return scaled[:samples]


def workload(record: Dataset, count: int, settings: Settings) -> dict[str, tuple[WorkloadModel, ...]]:
    """Return so many individuals of every kind: ``poly``, ``general``, and ``gp`` of a run with settings."""
    return {
        "poly": random_workload(monomial, count),
        "general": random_workload(tree, count),
        "gp": evolved_workload(record, count, settings),
    }


def candidate_text(individuals: Mapping[str, Sequence[WorkloadModel]]) -> str:
    """Return a workload as text: a line for the record's length, a kind, an individual, or a term."""
    lines = [f"{SAMPLES} samples"]
    for kind, candidates in individuals.items():
        lines.append(kind)
        for candidate in candidates:
            lines += ["individual", *(item.text for item in candidate.regressors)]
    return "\n".join(lines)


def fingerprint(individuals: Mapping[str, Sequence[WorkloadModel]]) -> str:
    """Return the SHA-256 of a workload's text, in hexadecimal."""
    return hashlib.sha256(candidate_text(individuals).encode()).hexdigest()


def monomial(draw: random.Random) -> Expression:
    """Draw a product of one to five lagged signals."""
    degree = draw.choices([1, 2, 3, 4, 5], [20, 25, 25, 18, 12])[0]
    return Apply(MUL, (*(_leaf(draw) for _ in range(degree)), Constant(1.0)))


def tree(draw: random.Random, height: int = 4) -> Expression:
    """Draw a tree of products, differences and signs, of at most a height."""
    if height == 0 or draw.random() < 0.15:
        return _leaf(draw)
    match draw.choices("*-sq", [35, 25, 15, 25])[0]:
        case "*":
            return Apply(MUL, (tree(draw, height - 1), tree(draw, height - 1)))
        case "-":
            return Apply(SUB, (tree(draw, height - 1), tree(draw, height - 1)))
        case "s":
            return Apply(SIGN, (tree(draw, height - 1),))
    return tree(draw, height - 1)


def full_tree(draw: random.Random, height: int) -> Expression:
    """Draw a tree of products and differences whose every leaf lies at a height."""
    if height == 0:
        return _leaf(draw)
    arguments = (full_tree(draw, height - 1), full_tree(draw, height - 1))
    return Apply(MUL if draw.random() < 0.5 else SUB, arguments)


def _leaf(draw: random.Random) -> Lagged:
    return Lagged(draw.choice((0, 1)), 1 + min(int(draw.expovariate(0.25)), DEEPEST - 1))


def random_workload(
    make: Callable[[random.Random], Expression], count: int, terms: int = TERMS
) -> tuple[WorkloadModel, ...]:
    """Draw individuals: y(k-1) and others, so many different regressors each, with small parameters."""
    draw, weigh = random.Random(1), random.Random(2)
    candidates: list[WorkloadModel] = []
    while len(candidates) < count:
        chosen = [regressor(Lagged(0, 1))[1]]
        while len(chosen) < terms:
            candidate = regressor(make(draw))[1]
            if candidate is not None and candidate.lags and candidate not in chosen:
                chosen.append(candidate)
        regressors = tuple(canonical_order(item for item in chosen if item is not None))
        # y(k-1) comes first in canonical order: with this weight the rest can't let it grow.
        theta = (0.97, *((weigh.random() - 0.5) * 0.004 for _ in regressors[1:]))
        candidates.append(WorkloadModel(regressors, theta, "none"))
    return tuple(candidates)


def evolved_workload(record: Dataset, count: int, settings: Settings) -> tuple[WorkloadModel, ...]:
    """Return individuals whose structure is new to a run, evenly spread over its course: island 0, seed 0.

    They have every gene that they were bred with: pruning is a part of their evaluation.
    """
    logging = _Logging(record, settings)
    island, _ = first_generation(0, 0, logging)
    while island.generation < settings.generations:
        island, _ = step(island, logging)
    evaluator = Evaluator(record, settings)
    last = [(1 + place) * len(logging.bred) // count - 1 for place in range(count)]
    return tuple(_bounded(logging.bred[position::-1], evaluator) for position in last)


class _Logging(Evaluator):
    """Keeps what it has to evaluate: the first individual of every structure."""

    def __init__(self, record: Dataset, settings: Settings) -> None:
        super().__init__(record, settings)
        self.bred: list[Individual] = []
        self._met: set[tuple[frozenset[int], bool]] = set()

    def evaluate(
        self, population: Sequence[tuple[Individual, bool]], bars: Sequence[float] | None = None
    ) -> tuple[Population, int]:
        for individual, pruned in population:
            key = self.gene_indices(individual), pruned
            if key not in self._met:
                self._met.add(key)
                self.bred.append(individual)
        return super().evaluate(population, bars)


def _bounded(individuals: Sequence[Individual], evaluator: Evaluator) -> WorkloadModel:
    """Return the first individual whose whole model, unpruned, stays bounded."""
    for individual in individuals:
        ((evaluated,), _) = evaluator.evaluate([(individual, False)])
        if isfinite(evaluated.fitness):
            return WorkloadModel(evaluated.regressors, evaluated.theta, evaluator.settings.constraints)
    raise ModelError("every individual of the search diverges on the record: something is broken")
