"""Comparison on one kind of individual: plain numpy, the kernels, and C compiled for each individual."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from statistics import median

from islands.errors import ModelError
from islands.export.fmu import find_compiler
from lab.speed import compiled_c, kernel_evaluator, plain_numpy
from lab.speed.clock import milliseconds
from lab.speed.workload import CASE1, INTERVAL, WARM_UP, WorkloadModel

#: Relative tolerance between the errors of two implementations, which add in different orders.
_SAME = 1e-9

#: Times of one individual in milliseconds, by name.
_Times = dict[str, float]


@dataclass(frozen=True, slots=True)
class Comparison:
    """CPU time of one individual in milliseconds: medians over the individuals of a kind.

    Attributes
    ----------
    numpy_ms, uncached_ms, cached_ms : float
        A whole evaluation, pruned by forward selection as often as in the paper's case 1: by plain numpy, by
        the kernels with an empty cache, and by the kernels with all inner products cached.
    numpy_simulation_ms, simulation_ms : float
        Multiple shooting alone.
    c_simulation_ms : float or None
        By C compiled for the individual; None if there is no compiler.
    simulation_fraction_of_c : float or None
        Median over the individuals of the time of C divided by the time of the kernels.
    gram_ms : float
        The Gram matrix of terms and target, including the evaluation of the columns.
    gram_flops : float
        Median of two operations per pair and row, divided by that time, in operations per second.
    """

    numpy_ms: float
    uncached_ms: float
    cached_ms: float
    numpy_simulation_ms: float
    simulation_ms: float
    c_simulation_ms: float | None
    simulation_fraction_of_c: float | None
    gram_ms: float
    gram_flops: float


def compare(
    candidates: Sequence[WorkloadModel],
    state: kernel_evaluator.Prepared,
    rounds: int,
    folder: Path,
    progress: Callable[[float], None],
) -> Comparison:
    """Measure every implementation on every individual, in turns, so that drift affects all equally.

    Parameters
    ----------
    rounds : int
        Number of measurements; the time of an individual is their median.
    folder : Path
        Folder for the compilation of C.
    progress : callable
        Receives the completed fraction.

    Raises
    ------
    ModelError
        If two implementations give different errors, or if the compiler fails.
    """
    rows = compiled_c.row_pointers(state.record, WARM_UP, INTERVAL)
    measured: list[_Times] = []
    for place, candidate in enumerate(candidates):
        compiled = _compiled(candidate, rows, folder) if find_compiler() else []
        _check(candidate, state, compiled)
        drawn = [_times(candidate, state, compiled) for _ in range(rounds)]
        times = {name: median(each[name] for each in drawn) for name in drawn[0]}
        pairs = (len(candidate.regressors) + 1) * (len(candidate.regressors) + 2) / 2
        times["gram_flops"] = 2.0 * pairs * (state.record.samples - WARM_UP) / (1e-3 * times["gram_ms"])
        if compiled:
            times["simulation_fraction_of_c"] = times["c_simulation_ms"] / times["simulation_ms"]
        measured.append(times)
        progress((place + 1) / len(candidates))
    medians = {name: median(each[name] for each in measured) for name in measured[0]}
    return Comparison(
        numpy_ms=medians["numpy_ms"],
        uncached_ms=medians["uncached_ms"],
        cached_ms=medians["cached_ms"],
        numpy_simulation_ms=medians["numpy_simulation_ms"],
        simulation_ms=medians["simulation_ms"],
        c_simulation_ms=medians.get("c_simulation_ms"),
        simulation_fraction_of_c=medians.get("simulation_fraction_of_c"),
        gram_ms=medians["gram_ms"],
        gram_flops=medians["gram_flops"],
    )


def _times(
    candidate: WorkloadModel, state: kernel_evaluator.Prepared, compiled: Sequence[Callable[[], float]]
) -> _Times:
    regressors, theta, record = candidate.regressors, candidate.theta, state.record
    times = {
        "uncached_ms": _evaluation(lambda pruned: kernel_evaluator.uncached_ms(state, candidate, pruned)),
        "numpy_ms": _evaluation(
            lambda pruned: milliseconds(
                lambda: plain_numpy.evaluate(regressors, theta, record, WARM_UP, INTERVAL, pruned)
            )
        ),
        "cached_ms": _evaluation(lambda pruned: kernel_evaluator.cached_ms(state, candidate, pruned)),
        "gram_ms": kernel_evaluator.gram_ms(state, candidate),
        "numpy_simulation_ms": milliseconds(
            lambda: plain_numpy.simulate(regressors, theta, record, WARM_UP, INTERVAL)
        ),
        "simulation_ms": kernel_evaluator.simulation_ms(state, candidate),
    }
    if compiled:
        times["c_simulation_ms"] = min(milliseconds(simulate) for simulate in compiled)
    return times


def _evaluation(time: Callable[[bool], float]) -> float:
    """Weight evaluations with and without pruning by their frequency in the paper's case 1."""
    return CASE1.prune * time(True) + (1.0 - CASE1.prune) * time(False)


def _compiled(
    candidate: WorkloadModel, rows: compiled_c.RowsPointer, folder: Path
) -> list[Callable[[], float]]:
    return [
        compiled_c.simulation(candidate.regressors, candidate.theta, rows, flags, folder)
        for flags in compiled_c.FLAGS
    ]


def _check(
    candidate: WorkloadModel, state: kernel_evaluator.Prepared, compiled: Sequence[Callable[[], float]]
) -> None:
    own = kernel_evaluator.squared_error(state, candidate)
    plain = plain_numpy.simulate(candidate.regressors, candidate.theta, state.record, WARM_UP, INTERVAL)
    for side, error in (("plain numpy", plain), *(("compiled C", simulate()) for simulate in compiled)):
        if not isclose(own, error, rel_tol=_SAME):
            raise ModelError(
                f"{side} simulates another model: its squared error is {error}, that of the kernels {own}; "
                "times of different work can't be compared, look at "
                f"{[item.text for item in candidate.regressors]}"
            )
