"""Evolution of state spaces with static units: selection, and the problem of a search."""

from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from math import log
from typing import cast

import numpy as np
from numpy.random import Generator, SeedSequence
from threadpoolctl import threadpool_limits

from islands.estimation.curve_models import add_curves
from islands.estimation.fitted_state_space import Draft, FittedStateSpace
from islands.estimation.latent_data import LatentData, make_latent_data
from islands.estimation.latent_models import find_front, fit_linear_systems, make_latent_model, make_odd
from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.engine import Caches
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import AnyIndividual, AnyPopulation, unique_structures
from islands.evolution.latent_variation import begin_system, cross, mutate
from islands.evolution.rng import Purpose
from islands.evolution.settings import Settings
from islands.models.latent import LatentModel
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome

#: Least error in the criterion: of a record without noise it has no limit.
_LEAST_FITNESS = 1e-300

#: Probability that a parent is drawn from the front of size and error.
_FROM_FRONT = 0.3

#: Units of the first population.
_FIRST_UNITS = (
    *(("tanh",) * count for count in (1, 2, 4, 6)),
    *((name,) for name in ("square", "cube", "abs", "root")),
    ("square", "cube"),
    *((name,) * 2 for name in ("hinge", "saturation", "dead zone", "bell")),
)

#: Orders whose linear system has larger mean squared errors than this multiple of the least are left out of
#: the first population. On held-out rows, a linear system may drift whose units would not.
_LARGEST_RATIO = 4.0

#: Rows of the criterion of the elite, at most: of a long record, its penalty would have no effect.
_MOST_ROWS = 6_000


def select_latent_elite(
    systems: Iterable[FittedStateSpace], count: int, rows: int
) -> tuple[FittedStateSpace, ...]:
    """Return the systems of the least criterion, each structure once, with the front of size and error.

    Parameters
    ----------
    systems : iterable of FittedStateSpace
    count : int
    rows : int
        Samples of the criterion.

    Returns
    -------
    tuple of FittedStateSpace
        Least criterion first. It is the logarithm of the error with the penalty of the number of parameters
        of the Bayesian information criterion (Schwarz, Annals of Statistics 6 (1978) 461-464): without it,
        systems grow.
    """

    def order(system: FittedStateSpace) -> tuple[float, int, tuple[str, ...]]:
        criterion = log(max(system.fitness, _LEAST_FITNESS)) + system.size * log(rows) / rows
        return criterion, system.size, system.key

    ordered = unique_structures(sorted(systems, key=order))
    front = find_front(ordered)[-count:]
    keys = {individual.key for individual in front}
    others = [individual for individual in ordered if individual.key not in keys][: count - len(front)]
    return tuple(sorted((*front, *others), key=order))


def select_parent(elite: Sequence[FittedStateSpace], contestants: int, rng: Generator) -> FittedStateSpace:
    """Return a system of the front, or the best one of a tournament."""
    if rng.random() < _FROM_FRONT:
        front = find_front(elite)
        return front[int(rng.integers(len(front)))]
    return elite[int(rng.integers(len(elite), size=contestants).min())]


@dataclass(frozen=True, slots=True, eq=False)
class LatentProblem:
    """Search problem of state spaces with units, shared by all islands.

    Attributes
    ----------
    record : Dataset
        Estimation data without missing values.
    settings : Settings
    linear : tuple of FittedStateSpace
        Linear systems, the starts of the first populations.
    curves : tuple of FittedStateSpace
        Linear systems with one curve, which the first elite contains.
    """

    record: Dataset
    settings: Settings
    linear: tuple[FittedStateSpace, ...]
    curves: tuple[FittedStateSpace, ...] = ()

    @property
    def data(self) -> LatentData:
        """Blocks of the record. The static conditions are those of the final estimation."""
        return make_latent_data(self.record, self.settings.constraints).without_statics()

    def settings_of(self, _island: int) -> Settings:
        """Return the settings of an island."""
        return self.settings

    def open(self, threads: int = 1) -> "LatentEvolution":
        """Return the steps of the islands in this process."""
        return LatentEvolution(self, threads)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Constants that were subtracted from the signals: none, since the system has a level."""
        return ()

    def make_model(self, individual: AnyIndividual) -> LatentModel:
        """Return the model of a system before the final estimation."""
        return make_latent_model(cast("FittedStateSpace", individual), self.data)


def make_latent_problem(record: Dataset, settings: Settings, steps: Steps) -> LatentProblem:
    """Make a search problem; fit its linear systems, and those with one curve.

    Raises
    ------
    StoppedError
        A stop is requested before the first linear system.
    """
    data = make_latent_data(record, settings.constraints).without_statics()
    linear = fit_linear_systems(record, data, steps)
    curves = add_curves(linear, data, settings.structure, steps=steps)
    return LatentProblem(record, settings, tuple(linear), tuple(curves))


class LatentEvolution:
    """Steps of the islands of a problem in one process.

    Parameters
    ----------
    problem : LatentProblem
    threads : int
        Largest number of threads that estimate the offspring of a generation.
    """

    def __init__(self, problem: LatentProblem, threads: int) -> None:
        self.problem, self._threads = problem, threads
        self._data = problem.data
        self._rows = min(problem.record.samples, _MOST_ROWS)

    @property
    def memory(self) -> Caches:
        """Memory of the caches; there are none."""
        return {}

    def first_generation(self, index: int, seed: int) -> tuple[Island, StepInfo]:
        """Estimate linear systems with random units."""
        settings, linear = self.problem.settings, _keep_orders(self.problem.linear)
        rng = _make_generator(seed, index, 0, -1)
        starts = list(product(linear, _FIRST_UNITS))
        drawn = rng.permutation(len(starts))[: settings.population] if starts else ()
        drafts = [
            begin_system(system, units, settings.structure, _make_generator(seed, index, 0, place))
            for place, (system, units) in enumerate(starts[at] for at in drawn)
        ]
        elite = (*self.problem.linear, *self.problem.curves)
        empty = Island(index, seed, 0, (), elite, with_entries(HallOfFame(), elite))
        return self._evaluate(empty, drafts)

    def step(self, island: Island) -> tuple[Island, StepInfo]:
        """Estimate the offspring of the elite, and update elite and hall of fame."""
        following = replace(island, generation=island.generation + 1)
        drafts = [
            self._vary(island, _make_generator(island.seed, island.index, following.generation, place))
            for place in range(self.problem.settings.population)
        ]
        return self._evaluate(following, drafts)

    def complete_fitness(self, population: Sequence[AnyIndividual]) -> list[float]:
        """Return the fitness of each individual; no evaluation is abandoned."""
        return [each.fitness for each in population]

    def select_elite(self, contenders: Sequence[AnyIndividual], _island: int) -> AnyPopulation:
        """Return the elite among contenders; see `select_latent_elite`."""
        systems = cast("Sequence[FittedStateSpace]", contenders)
        return select_latent_elite(systems, self.problem.settings.elites, self._rows)

    def _vary(self, island: Island, rng: Generator) -> Draft:
        settings, elite = self.problem.settings, cast("Sequence[FittedStateSpace]", island.elite)
        parent, other = (select_parent(elite, settings.tournament, rng) for _ in range(2))
        if rng.random() < settings.crossover:
            crossed = cross(parent, other, self._data, settings.structure, rng)
            if crossed is not None:
                return crossed
        return mutate(parent, settings.structure, rng)

    def _estimate(self, draft: Draft) -> FittedStateSpace | EvaluationOutcome:
        return make_odd(draft, self._data).estimate(self._data)

    def _evaluate(self, island: Island, drafts: Sequence[Draft]) -> tuple[Island, StepInfo]:
        """Estimate the drafts of a generation and select the elite among them and the elite before."""
        # The sums of a matrix product depend on the number of threads of the library.
        with threadpool_limits(1), ThreadPoolExecutor(self._threads) as threads:
            estimated = list(threads.map(self._estimate, drafts))
        population = tuple(each for each in estimated if not isinstance(each, EvaluationOutcome))
        hall = with_entries(island.hall_of_fame, population)
        known = {individual.key for individual in island.elite}
        outcomes = Counter(
            each.verdict.name.lower() if isinstance(each, EvaluationOutcome) else "ok" for each in estimated
        )
        info = StepInfo(
            island.generation,
            len(estimated),
            len(population) - len({individual.key for individual in population} - known),
            dict(outcomes),
            {size: entry.fitness for size, entry in hall.best().items()},
        )
        elite = self.select_elite((*island.elite, *population), island.index)
        return replace(island, population=population, elite=elite, hall_of_fame=hall), info


def _keep_orders(linear: Sequence[FittedStateSpace]) -> list[FittedStateSpace]:
    """Return the linear systems whose error on the used or on the held-out rows is close to the least."""
    used = _LARGEST_RATIO * min((model.mean_square for model in linear), default=0.0)
    held_out = _LARGEST_RATIO * min((model.fitness for model in linear), default=0.0)
    return [model for model in linear if model.mean_square <= used or model.fitness <= held_out]


def _make_generator(seed: int, island: int, generation: int, place: int) -> Generator:
    """Return the random generator of an offspring, or of the first population for a place of -1."""
    key = (island, generation, int(Purpose.VARIATION), place + 1)
    return np.random.default_rng(SeedSequence(seed, spawn_key=key))
