"""Timed searches of the paper's case 1: one island in this process, or several in one process each."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.offspring import Offspring
from islands.evolution.settings import Settings
from islands.kernels.breeding import Individuals
from islands.process_pool import prepare_process
from islands.records.dataset import Dataset
from lab.speed import kernel_evaluator
from lab.speed.clock import cpu, wall


@dataclass(frozen=True, slots=True)
class Run:
    """Cost of the search of one island.

    Attributes
    ----------
    evaluations, duplicates : int
        Number of individuals, and number of those with a structure that was known before.
    cpu_s, wall_s : float
        CPU time and wall-clock time of the whole search, from the first population on.
    evaluating_cpu_s : float
        Part of the CPU time that is spent in the evaluator; the rest is breeding.
    caches : mapping
        Bytes that each cache uses at the end.
    """

    evaluations: int
    duplicates: int
    cpu_s: float
    wall_s: float
    evaluating_cpu_s: float
    caches: Mapping[str, int]

    @property
    def amortised_ms(self) -> float:
        """CPU time of the evaluator in milliseconds per new structure."""
        return 1e3 * self.evaluating_cpu_s / (self.evaluations - self.duplicates)

    @property
    def per_cpu_second(self) -> float:
        """Individuals per second of CPU time, including breeding."""
        return self.evaluations / self.cpu_s

    @property
    def per_second(self) -> float:
        """Individuals per second of wall-clock time."""
        return self.evaluations / self.wall_s


def run_island(
    record: Dataset,
    settings: Settings,
    index: int,
    progress: Callable[[float], None] = lambda _fraction: None,
) -> Run:
    """Run one island from its first population to the last generation of the settings."""
    evaluator = _Timed(record, settings)
    began_cpu, began = cpu(), wall()
    island, info = first_generation(index, 0, evaluator)
    evaluations = info.evaluations
    while island.generation < settings.generations:
        island, info = step(island, evaluator)
        evaluations += info.evaluations
        progress(island.generation / settings.generations)
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
    """Run islands at the same time, each in a new process; return the wall-clock seconds and every run.

    The seconds include the start of the processes.

    Parameters
    ----------
    warm : bool
        Whether to run two generations before the timed run, so that its time excludes the loading of kernels.
    """
    began = wall()
    with ProcessPoolExecutor(len(indices), get_context("spawn"), prepare_process) as processes:
        job = partial(_warm_run if warm else run_island, record, settings)
        runs = tuple(processes.map(job, indices))
    return wall() - began, runs


def _warm_run(record: Dataset, settings: Settings, index: int) -> Run:
    run_island(record, replace(settings, generations=1), index)
    return run_island(record, settings, index)


class _Timed(Evaluator):
    """Evaluator that measures its CPU time in seconds and counts known structures."""

    def __init__(self, record: Dataset, settings: Settings) -> None:
        super().__init__(record, settings)
        self.spent = 0.0
        self.duplicates = 0

    def evaluate_genes(
        self,
        individuals: Individuals,
        pruned: NDArray[np.bool_],
        thresholds: Sequence[float] | None = None,
    ) -> tuple[Offspring, int]:
        began = cpu()
        evaluated, duplicates = super().evaluate_genes(individuals, pruned, thresholds)
        self.spent += cpu() - began
        # A call without thresholds has no new individuals: it evaluates abandoned ones to the end.
        self.duplicates += duplicates if thresholds is not None else 0
        return evaluated, duplicates
