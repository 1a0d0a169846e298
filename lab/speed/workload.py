"""Workload of the benchmark: a record and three kinds of individuals.

``poly`` are products of lagged signals, ``general`` random trees, ``gp`` individuals of a real search. All
are drawn from fixed seeds. A hash of their text shows whether two benchmarks measured the same workload.
"""

import hashlib
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.individual import Individual
from islands.evolution.offspring import Offspring
from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands.expressions.primitives import MUL, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged
from islands.kernels.breeding import Individuals
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor
from islands.records.dataset import Dataset
from islands.systems.catalogue import make_record

#: Settings of the paper's case 1, with the choices of its preset when the goals were set: another selection
#: gives individuals of another size, whose times cannot be compared with earlier ones.
CASE1 = replace(
    PRESETS["paper-case1"], tournament=3, distinct=False, niches=True, overlong="truncate", prune_copies=True
)

#: Number of samples before the first row.
WARM_UP = CASE1.maximum_lag

#: Number of samples of a shooting interval.
INTERVAL = CASE1.shooting

#: Number of samples of the record.
SAMPLES = 100_000

#: Number of terms of a random individual.
TERMS = 10

#: Largest lag of a random individual.
MAX_LAG = 25

#: Number of islands of the paper's population of 500.
ISLANDS = 2

#: Settings of one of these islands.
ISLAND = replace(CASE1, population=CASE1.population // ISLANDS)


@dataclass(frozen=True, slots=True)
class WorkloadModel:
    """Model to evaluate.

    Attributes
    ----------
    regressors : tuple of Regressor
        In canonical order.
    theta : tuple of float
        Parameters with which the model stays bounded on the record, so that every simulation is complete.
    constraints : str
        Name of the parameter constraint under which the kernels estimate the parameters.
    """

    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    constraints: str


def benchmark_record(samples: int = SAMPLES) -> Dataset:
    """Return the first samples of the piezo record, in units of three standard deviations.

    With this scaling, products of many factors neither vanish nor grow.
    """
    whole = make_record("bouc-wen-piezo", "consistent", "estimation")
    scaled = Dataset(whole.u / (3 * whole.u.std()), whole.y / (3 * whole.y.std()), whole.dt)
    return scaled[:samples]


def workload(record: Dataset, count: int, settings: Settings) -> dict[str, tuple[WorkloadModel, ...]]:
    """Return ``count`` individuals of each kind: ``poly``, ``general``, and ``gp`` of a search."""
    return {
        "poly": random_workload(monomial, count),
        "general": random_workload(tree, count),
        "gp": evolved_workload(record, count, settings),
    }


def candidate_text(individuals: Mapping[str, Sequence[WorkloadModel]]) -> str:
    """Return a workload as text: one line each for the record length, a kind, an individual and a term."""
    lines = [f"{SAMPLES} samples"]
    for kind, candidates in individuals.items():
        lines.append(kind)
        for candidate in candidates:
            lines += ["individual", *(item.text for item in candidate.regressors)]
    return "\n".join(lines)


def fingerprint(individuals: Mapping[str, Sequence[WorkloadModel]]) -> str:
    """Return the SHA-256 of the text of a workload, in hexadecimal."""
    return hashlib.sha256(candidate_text(individuals).encode()).hexdigest()


def monomial(draw: random.Random) -> Expression:
    """Draw a product of one to five lagged signals."""
    degree = draw.choices([1, 2, 3, 4, 5], [20, 25, 25, 18, 12])[0]
    return Apply(MUL, (*(_draw_leaf(draw) for _ in range(degree)), Constant(1.0)))


def tree(draw: random.Random, height: int = 4) -> Expression:
    """Draw a tree of products, differences and signs with a maximum height."""
    if height == 0 or draw.random() < 0.15:
        return _draw_leaf(draw)
    match draw.choices("*-sq", [35, 25, 15, 25])[0]:
        case "*":
            return Apply(MUL, (tree(draw, height - 1), tree(draw, height - 1)))
        case "-":
            return Apply(SUB, (tree(draw, height - 1), tree(draw, height - 1)))
        case "s":
            return Apply(SIGN, (tree(draw, height - 1),))
    return tree(draw, height - 1)


def full_tree(draw: random.Random, height: int) -> Expression:
    """Draw a tree of products and differences in which every leaf is at the given height."""
    if height == 0:
        return _draw_leaf(draw)
    arguments = (full_tree(draw, height - 1), full_tree(draw, height - 1))
    return Apply(MUL if draw.random() < 0.5 else SUB, arguments)


def _draw_leaf(draw: random.Random) -> Lagged:
    return Lagged(draw.choice((0, 1)), 1 + min(int(draw.expovariate(0.25)), MAX_LAG - 1))


def random_workload(
    make: Callable[[random.Random], Expression], count: int, terms: int = TERMS
) -> tuple[WorkloadModel, ...]:
    """Draw individuals of y(k-1) and other, distinct regressors with small parameters."""
    draw, weigh = random.Random(1), random.Random(2)
    candidates: list[WorkloadModel] = []
    while len(candidates) < count:
        chosen = [regressor(Lagged(0, 1))[1]]
        while len(chosen) < terms:
            candidate = regressor(make(draw))[1]
            if candidate is not None and candidate.lags and candidate not in chosen:
                chosen.append(candidate)
        regressors = tuple(canonical_order(item for item in chosen if item is not None))
        # y(k-1) is first in canonical order; with this parameter the other terms cannot let the model grow.
        theta = (0.97, *((weigh.random() - 0.5) * 0.004 for _ in regressors[1:]))
        candidates.append(WorkloadModel(regressors, theta, "none"))
    return tuple(candidates)


def evolved_workload(record: Dataset, count: int, settings: Settings) -> tuple[WorkloadModel, ...]:
    """Return individuals with structures that were new to a search, evenly spread over it (island 0, seed 0).

    They have all genes with which they were bred, since pruning is a part of the evaluation.
    """
    recorder = _RecordingEvaluator(record, settings)
    island, _ = first_generation(0, 0, recorder)
    while island.generation < settings.generations:
        island, _ = step(island, recorder)
    evaluator = Evaluator(record, settings)
    last = [(1 + place) * len(recorder.bred) // count - 1 for place in range(count)]
    return tuple(_find_bounded(recorder.bred[position::-1], evaluator) for position in last)


class _RecordingEvaluator(Evaluator):
    """Evaluator that records the first individual of every structure."""

    def __init__(self, record: Dataset, settings: Settings) -> None:
        super().__init__(record, settings)
        self.bred: list[Individual] = []
        self._seen_structures: set[tuple[frozenset[int], bool]] = set()

    def evaluate_genes(
        self,
        individuals: Individuals,
        pruned: NDArray[np.bool_],
        thresholds: Sequence[float] | None = None,
    ) -> tuple[Offspring, int]:
        index = self.gene_index
        rows = zip(*(array.tolist() for array in (*individuals, pruned)), strict=True)
        for numbers, length, decision in rows:
            genes = tuple([index.genes[number] for number in numbers[:length]])
            key = frozenset(map(index.index_of, genes)), decision
            if key not in self._seen_structures:
                self._seen_structures.add(key)
                self.bred.append(Individual(genes))
        return super().evaluate_genes(individuals, pruned, thresholds)


def _find_bounded(individuals: Sequence[Individual], evaluator: Evaluator) -> WorkloadModel:
    """Return the first individual whose unpruned model stays bounded."""
    for individual in individuals:
        ((evaluated,), _) = evaluator.evaluate([(individual, False)])
        if isfinite(evaluated.fitness):
            return WorkloadModel(evaluated.regressors, evaluated.theta, evaluator.settings.constraints)
    raise ModelError(
        "every individual of the search diverges on the record: check the kernels and the record"
    )
