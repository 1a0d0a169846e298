"""Measurement of the kernels: the only module of the benchmark that calls them.

Every time is the CPU time in milliseconds of one individual, with warm processor caches. Each individual is a
separate call and includes its overhead; a search needs one call per generation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.evaluation import Evaluator
from islands.evolution.gene_index import GeneIndex
from islands.expressions.tree import Lagged
from islands.kernels.err_selection import OUTPUT
from islands.kernels.gram import gram
from islands.kernels.interpreter import Program
from islands.kernels.pair_table import clear, pair_table
from islands.kernels.population import PopulationContext, SelectedTerms, empty_results, empty_terms, evaluate
from islands.kernels.regressor_columns import Rows
from islands.kernels.simulate import COMPLETE, Layout, simulate
from islands.program.regressor_matrix import select_rows
from islands.program.term_pool import link
from islands.records.dataset import Dataset
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound
from lab.speed.clock import milliseconds
from lab.speed.workload import INTERVAL, WARM_UP, WorkloadModel

#: Size in bytes of a table of inner products for one individual.
_TABLE_BYTES = 1 << 14


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Record in the form of the kernels; made once per run and not part of any measurement.

    Attributes
    ----------
    record : Dataset
    cut, step : Layout
        All shooting intervals, and the first step of the first interval only.
    rows : Rows
    bound : float
    """

    record: Dataset
    cut: Layout
    step: Layout
    rows: Rows
    bound: float


def prepare_record(record: Dataset) -> Prepared:
    """Prepare a record."""
    return Prepared(
        record,
        layout(record, WARM_UP, INTERVAL),
        layout(record[: WARM_UP + 1], WARM_UP, INTERVAL),
        select_rows(record, WARM_UP),
        divergence_bound(record.y),
    )


def uncached_ms(state: Prepared, candidate: WorkloadModel, pruned: bool) -> float:
    """Time an evaluation with an empty cache: inner products, selection, estimation, simulation."""
    return milliseconds(_evaluation(state, candidate, pruned, cached=False))


def cached_ms(state: Prepared, candidate: WorkloadModel, pruned: bool) -> float:
    """Time an evaluation with all inner products cached."""
    return milliseconds(_evaluation(state, candidate, pruned, cached=True))


def simulation_ms(state: Prepared, candidate: WorkloadModel) -> float:
    """Time the simulation alone; the program is generated beforehand."""
    program, theta = link(candidate.regressors), np.array(candidate.theta)
    return milliseconds(lambda: _squared_errors(state, program, theta))


def gram_ms(state: Prepared, candidate: WorkloadModel) -> float:
    """Time the inner products of all terms and the target, including the evaluation of the columns."""
    program = link([*candidate.regressors, Lagged(0, 0)])
    numbers = np.empty((program.degree.size, program.degree.size))
    return milliseconds(lambda: gram(program, state.rows, numbers))


def squared_error(state: Prepared, candidate: WorkloadModel) -> float:
    """Return the sum of squared errors of a simulation over all whole intervals."""
    squared = _squared_errors(state, link(candidate.regressors), np.array(candidate.theta))
    return float(squared[state.cut.length == INTERVAL].sum())


def cache_statistics(evaluator: Evaluator) -> Mapping[str, int]:
    """Return the bytes that each cache of an evaluator uses."""
    return {f"{name}_bytes": taken for name, (taken, _) in evaluator.memory.items()}


def _evaluation(state: Prepared, candidate: WorkloadModel, pruned: bool, cached: bool) -> Callable[[], None]:
    """Return a function that evaluates an individual, but simulates it with the given parameters.

    Estimated parameters may diverge, and terms that selection drops are not simulated. In both cases the
    kernels would do less work than the other implementations. The kernel of a search therefore simulates a
    single step with the estimated parameters, and the whole simulation is a separate call. The tolerance of
    the selection is zero, so that every independent term is estimated.

    Raises
    ------
    ModelError
        If the simulation ends early.
    """
    size = len(candidate.regressors)
    index = GeneIndex(CONSTRAINTS[candidate.constraints], [Lagged(0, 0)])
    terms = np.array([[index.index_of(item.expression) for item in candidate.regressors]], np.int64)
    given, selected = SelectedTerms(terms, np.array([size])), empty_terms(1, size)
    decided, allowed = np.array([pruned]), np.full(size + 1, inf)
    pairs, program, theta = pair_table(_TABLE_BYTES), link(candidate.regressors), np.array(candidate.theta)
    context = PopulationContext(
        0, -1, OUTPUT, 0.0, index.nodes, index.groups, pairs, state.rows, state.step, state.bound
    )
    results = empty_results(1, size)

    def call() -> None:
        if not cached:
            clear(pairs)
        evaluate(given, decided, allowed, context, selected, results)
        _squared_errors(state, program, theta)

    if not np.isfinite(_squared_errors(state, program, theta)).all():
        raise ModelError(
            "the simulation ends early and would do less work than plain numpy: choose other parameters for "
            f"{[item.text for item in candidate.regressors]}"
        )
    return call


def _squared_errors(state: Prepared, program: Program, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared error of every interval; all are infinite if one interval diverges."""
    squared = np.empty(len(state.cut.start))
    diverged = np.empty(len(state.cut.start), np.int64)
    ending = simulate(program, theta, state.cut, state.bound, inf, False, squared, diverged, np.empty(0))
    return squared if ending == COMPLETE else np.full_like(squared, inf)
