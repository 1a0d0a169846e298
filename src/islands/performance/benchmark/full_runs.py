"""Whole searches of the paper's case 1, timed: one island in this process, or several in one process each."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context

from islands.data.dataset import Dataset
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual, Population
from islands.evolution.island import first_generation, step
from islands.evolution.settings import Settings
from islands.performance.benchmark import kernel_evaluator
from islands.performance.benchmark.clock import cpu, wall


@dataclass(frozen=True, slots=True)
class Run:
    """What an island's search took.

    Attributes
    ----------
    evaluations, duplicates : int
        Individuals, and those among them whose structure was known.
    cpu_s, wall_s : float
        Of the whole search, from the first population on.
    evaluating_cpu_s : float
        Of that, in the evaluator: the rest is breeding.
    caches : mapping
        What the caches hold at the end.
    """

    evaluations: int
    duplicates: int
    cpu_s: float
    wall_s: float
    evaluating_cpu_s: float
    caches: Mapping[str, int]

    @property
    def amortised_ms(self) -> float:
        """CPU milliseconds of the evaluator for every structure that was not known."""
        return 1e3 * self.evaluating_cpu_s / (self.evaluations - self.duplicates)

    @property
    def per_cpu_second(self) -> float:
        """Individuals per second of CPU time, breeding included."""
        return self.evaluations / self.cpu_s

    @property
    def per_second(self) -> float:
        """Individuals per second on the wall."""
        return self.evaluations / self.wall_s


def run_island(
    record: Dataset, settings: Settings, index: int, tell: Callable[[float], None] = lambda _share: None
) -> Run:
    """Run one island from its first population to the settings' last generation."""
    evaluator = _Timed(record, settings)
    began_cpu, began = cpu(), wall()
    island, info = first_generation(index, 0, evaluator)
    evaluations = info.evaluations
    while island.generation < settings.generations:
        island, info = step(island, evaluator)
        evaluations += info.evaluations
        tell(island.generation / settings.generations)
    return Run(
        evaluations,
        evaluator.duplicates,
        cpu() - began_cpu,
        wall() - began,
        evaluator.spent,
        dict(kernel_evaluator.cache_statistics(evaluator)),
    )


def run_in_processes(
    record: Dataset, settings: Settings, indices: Sequence[int], warm: bool = False
) -> tuple[float, tuple[Run, ...]]:
    """Run islands at the same time, each in a new process; return the seconds on the wall, and every run.

    The seconds begin before the processes do.

    Parameters
    ----------
    warm : bool
        Go through two generations before a run is timed, so that it holds no loading of kernels.
    """
    began = wall()
    with ProcessPoolExecutor(len(indices), get_context("spawn")) as processes:
        job = partial(_warm_run if warm else run_island, record, settings)
        runs = tuple(processes.map(job, indices))
    return wall() - began, runs


def _warm_run(record: Dataset, settings: Settings, index: int) -> Run:
    run_island(record, replace(settings, generations=1), index)
    return run_island(record, settings, index)


class _Timed(Evaluator):
    """An evaluator that knows how much CPU time it took, in seconds, and how much it knew already."""

    def __init__(self, record: Dataset, settings: Settings) -> None:
        super().__init__(record, settings)
        self.spent = 0.0
        self.duplicates = 0

    def evaluate(
        self, population: Sequence[tuple[Individual, bool]], bars: Sequence[float] | None = None
    ) -> tuple[Population, int]:
        began = cpu()
        evaluated, duplicates = super().evaluate(population, bars)
        self.spent += cpu() - began
        # Without bars nobody is new: an individual of before is evaluated to its end.
        self.duplicates += duplicates if bars is not None else 0
        return evaluated, duplicates
