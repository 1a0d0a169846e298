"""Complete benchmark, from the record to the report."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from islands.progress import ProgressCallback
from islands.records.dataset import Dataset
from lab.speed import kernel_evaluator
from lab.speed.clock import refuse_threads
from lab.speed.comparison import Comparison, compare
from lab.speed.full_runs import Run, run_in_processes, run_island
from lab.speed.machine import peak, this_machine
from lab.speed.report import BenchmarkReport
from lab.speed.scaling import (
    against_islands,
    against_samples,
    against_terms,
    against_tree_size,
)
from lab.speed.workload import (
    ISLAND,
    ISLANDS,
    SAMPLES,
    benchmark_record,
    fingerprint,
    workload,
)


@dataclass(frozen=True, slots=True)
class BenchmarkSize:
    """Amount of work of a benchmark.

    Attributes
    ----------
    individuals, rounds : int
        Number of individuals of every kind, and number of measurements of each.
    scaling : int
        Number of individuals at every point of a scaling.
    generations : int
        Generations of the searches that measure individuals per second.
    parallel : int
        Generations of the searches that compare one process with two.
    case1 : bool
        Whether to run the whole case 1.
    """

    individuals: int
    rounds: int
    scaling: int
    generations: int
    parallel: int
    case1: bool


#: Size of the full benchmark.
FULL = BenchmarkSize(30, 3, 7, ISLAND.generations, 100, True)

#: Size of the quick benchmark.
QUICK = BenchmarkSize(4, 1, 2, 10, 10, False)


def measure(quick: bool, progress: ProgressCallback) -> BenchmarkReport:
    """Run the benchmark.

    Parameters
    ----------
    progress : ProgressCallback
        Receives the current measurement and the completed fraction.

    Raises
    ------
    SettingsError
        If the linear algebra library uses several threads.
    ModelError
        If two implementations give different results, or if the compiler fails.
    """
    refuse_threads()
    effort = QUICK if quick else FULL
    progress("record and individuals", 0.0)
    record = benchmark_record()
    searched = replace(ISLAND, generations=effort.generations)
    individuals = workload(record, effort.individuals, searched)
    state = kernel_evaluator.prepare_record(record)
    with TemporaryDirectory() as folder:
        kinds: dict[str, Comparison] = {}
        for kind, candidates in individuals.items():
            report = _part(progress, f"evaluations: {kind}", 0.05 + 0.1 * len(kinds), 0.1)
            kinds[kind] = compare(candidates, state, effort.rounds, Path(folder), report)
        peak_flops = peak(Path(folder))
    scalings = [
        against_samples(record, effort.scaling, _part(progress, "cost against samples", 0.35, 0.04)),
        against_terms(state, effort.scaling, _part(progress, "cost against terms", 0.39, 0.04)),
        against_tree_size(state, effort.scaling, _part(progress, "cost against tree size", 0.43, 0.04)),
    ]
    runs = {}
    for share, samples in ((0.47, SAMPLES), (0.65, SAMPLES // 10)):
        report = _part(progress, f"search on {samples} samples", share, 0.15)
        runs[f"n{samples}"] = run_island(record[:samples], searched, 0, report)
    progress("search in one process, then in two", 0.8)
    together = _processes(record, effort.parallel)
    alone, pair = (sum(run.per_second for run in each) for each in together.values())
    scalings.append(against_islands(together))
    case1 = None
    if effort.case1:
        progress("the whole case 1, two islands in two processes", 0.85)
        case1, _ = run_in_processes(record, ISLAND, range(ISLANDS))
    return BenchmarkReport(
        quick=quick,
        workload=fingerprint(individuals),
        samples=record.samples,
        individuals=effort.individuals,
        kinds=kinds,
        peak_flops=peak_flops,
        runs=runs,
        case1_wall_s=case1,
        parallel_efficiency_2=pair / (2.0 * alone),
        scalings=tuple(scalings),
        machine=this_machine(),
    )


def _processes(record: Dataset, generations: int) -> dict[int, tuple[Run, ...]]:
    """Run the same island in one process, and in two processes at the same time."""
    settings = replace(ISLAND, generations=generations)
    return {count: run_in_processes(record, settings, [0] * count, warm=True)[1] for count in (1, 2)}


def _part(progress: ProgressCallback, text: str, begin: float, share: float) -> Callable[[float], None]:
    """Report the start of a part of the benchmark; return a callback for the completed fraction of it."""
    progress(text, begin)
    return lambda done: progress(text, begin + share * done)
