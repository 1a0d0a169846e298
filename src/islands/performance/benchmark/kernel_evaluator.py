"""Our side of the comparison: the one module of the benchmark that calls the kernels.

Every time is the CPU milliseconds of one individual with warm caches of the processor. An individual is a
call of its own, and pays for it: a search shares one call in a generation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import ModelError
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.gene_index import GeneIndex
from islands.kernels.gram import gram
from islands.kernels.interpreter import Program
from islands.kernels.pair_table import clear, pair_table
from islands.kernels.population import PopulationContext, empty_results, evaluate
from islands.kernels.regressor_columns import Rows
from islands.kernels.simulate import COMPLETE, Layout, simulate
from islands.model.expression import Lagged
from islands.performance.benchmark.clock import milliseconds
from islands.performance.benchmark.workload import INTERVAL, WARM_UP, WorkloadModel
from islands.program.regressor_matrix import evaluate_terms
from islands.program.term_pool import link
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound

#: Bytes of a table of inner products for one individual: emptied as often as nothing shall be known.
_TABLE = 1 << 14


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A record as the kernels want it: made once for a run, and not measured.

    Attributes
    ----------
    record : Dataset
    cut, step : Layout
        All shooting intervals, and the first step of the first one alone.
    rows : Rows
    bound : float
    """

    record: Dataset
    cut: Layout
    step: Layout
    rows: Rows
    bound: float


def prepared(record: Dataset) -> Prepared:
    """Prepare a record."""
    return Prepared(
        record,
        layout(record, WARM_UP, INTERVAL),
        layout(record[: WARM_UP + 1], WARM_UP, INTERVAL),
        evaluate_terms(record, WARM_UP),
        divergence_bound(record),
    )


def uncached_ms(state: Prepared, candidate: WorkloadModel, pruned: bool) -> float:
    """Time an evaluation to which nothing is known: inner products, selection, estimate, simulation."""
    return milliseconds(_evaluation(state, candidate, pruned, cached=False))


def cached_ms(state: Prepared, candidate: WorkloadModel, pruned: bool) -> float:
    """Time an evaluation to which every inner product is known."""
    return milliseconds(_evaluation(state, candidate, pruned, cached=True))


def simulation_ms(state: Prepared, candidate: WorkloadModel) -> float:
    """Time the simulation alone, the individual linked already."""
    program, theta = link(candidate.regressors), np.array(candidate.theta)
    return milliseconds(lambda: _squared_errors(state, program, theta))


def gram_ms(state: Prepared, candidate: WorkloadModel) -> float:
    """Time the inner products of all terms and the target, columns made in the same call."""
    program = link([*candidate.regressors, Lagged(0, 0)])
    numbers = np.empty((program.degree.size, program.degree.size))
    return milliseconds(lambda: gram(program, state.rows, numbers))


def squared_error(state: Prepared, candidate: WorkloadModel) -> float:
    """Return the squared error of a simulation, summed over all whole intervals."""
    squared = _squared_errors(state, link(candidate.regressors), np.array(candidate.theta))
    return float(squared[state.cut.length == INTERVAL].sum())


def cache_statistics(evaluator: Evaluator) -> Mapping[str, int]:
    """Return the bytes that an evaluator's caches take."""
    return {f"{name}_bytes": taken for name, (taken, _) in evaluator.memory.items()}


def _evaluation(state: Prepared, candidate: WorkloadModel, pruned: bool, cached: bool) -> Callable[[], None]:
    """Return a call that evaluates an individual, but simulates with the parameters given.

    Those that least squares finds may diverge, and what selection drops is not simulated: either would make
    our work less than that of the other sides. So the kernel of a search simulates a single step with what it
    found, and the whole simulation is a call of its own. The tolerance of selection is zero: all is estimated
    that does not depend on the rest.

    Raises
    ------
    ModelError
        The simulation ends early.
    """
    size = len(candidate.regressors)
    vocabulary = GeneIndex(CONSTRAINTS[candidate.constraints], [Lagged(0, 0)])
    terms = np.array([[vocabulary.index_of(item.expression) for item in candidate.regressors]], np.int64)
    sizes, decided, allowed = np.array([size]), np.array([pruned]), np.full(size + 1, inf)
    pairs, program, theta = pair_table(_TABLE), link(candidate.regressors), np.array(candidate.theta)
    context = PopulationContext(
        0, 0.0, vocabulary.nodes, vocabulary.groups, pairs, state.rows, state.step, state.bound
    )
    results = empty_results(1, size)

    def call() -> None:
        if not cached:
            clear(pairs)
        evaluate(terms, sizes, decided, allowed, context, results)
        _squared_errors(state, program, theta)

    if not np.isfinite(_squared_errors(state, program, theta)).all():
        raise ModelError(
            "the simulation ends early and would take less time than plain numpy's: give other parameters to "
            f"{[item.text for item in candidate.regressors]}"
        )
    return call


def _squared_errors(state: Prepared, program: Program, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared error of every interval; all are infinite where one diverges."""
    squared = np.empty(len(state.cut.start))
    diverged = np.empty(len(state.cut.start), np.int64)
    ending = simulate(program, theta, state.cut, state.bound, inf, False, squared, diverged, np.empty(0))
    return squared if ending == COMPLETE else np.full_like(squared, inf)
