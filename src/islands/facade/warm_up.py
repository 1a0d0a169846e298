"""Compilation of all kernels before the first use."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from signal import SIGKILL, raise_signal
from threading import Thread
from typing import Any, Final

import numpy as np

from islands.available_cpus import count_cpus
from islands.estimation.estimate import estimate
from islands.estimation.forward_selection import SelectionProblem, make_selection_problem, select_forward
from islands.estimation.linear.identify import identify_linear
from islands.estimation.structure_selection.certificate import SubsetSearch
from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.presets import resolve_settings
from islands.evolution.rng import Purpose, Stream
from islands.evolution.variation import random_individuals
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Lagged
from islands.facade.fit import fit_record
from islands.facade.identify import identify_record
from islands.kernels.jit_cache import cache_folder, ready
from islands.kernels.pair_table import complete_pairs
from islands.kernels.population import (
    PopulationContext,
    SelectedTerms,
    empty_results,
    empty_terms,
    evaluate_individuals,
    select_terms,
)
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import make_model
from islands.program.primitive_functions import row_address
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.systems.catalogue import make_record
from islands.systems.published_models import PUBLISHED

#: Changed settings of a search that calls every kernel and takes no time.
SMALL: Final[Mapping[str, Any]] = {
    "population": 10,
    "generations": 1,
    "max_terms": 3,
    "initial_terms": (1, 3),
    "library_degree": 1,
    "shooting": 100,
}

#: Terms of one structure, which consists of term 1, and its size.
_ONE_TERM = SelectedTerms(np.ones((1, 1), np.int64), np.ones(1, np.int64))


def warm_up(report: Callable[[str], None] = print) -> bool:
    """Compile the kernels into the cache of the user, once per version and processor.

    Parameters
    ----------
    report : callable
        Receives a line for the user before a long step.

    Returns
    -------
    bool
        Whether kernels had to be compiled.
    """
    return ready(_use_all_kernels, report)


def _use_all_kernels() -> None:
    """Call every kernel once with each of its argument types."""
    record = _make_record()
    with _second_process():
        # Half of the time, and all that this process compiles if the other one compiles the rest meanwhile.
        _evaluate_individual(_make_context(record))
        for constraints in ("none", "hysteresis"):
            identify_record(record, preset="hysteresis", constraints=constraints, **SMALL)
    fit_record(record, library="phi-polynomial", max_terms=3)
    identify_linear(record.u, record.y, max_order=1)
    _simulate_two_outputs(record)


def use_other_kernels() -> None:
    """Call all kernels but the evaluation of individuals, and compile the row functions of the primitives."""
    record = _make_record()
    context = _make_context(record)
    complete_pairs(*_ONE_TERM, context.target, context.nodes, context.pairs, context.rows)
    select_terms(_ONE_TERM, np.ones(1, np.bool_), context, empty_terms(1, 1))
    evaluator = _make_evaluator(record)
    random_individuals(
        1, evaluator.settings, record.inputs, evaluator.gene_index, Stream(0, 0, 0, Purpose.INITIAL)
    )
    model = PUBLISHED["13"].model
    problem = make_selection_problem(model.regressors, record, "none")
    if isinstance(problem, SelectionProblem):
        select_forward(problem, 3)
        SubsetSearch(problem, 3).certify(100)
    for primitive in PRIMITIVES.values():
        row_address(primitive)
    free_run(model, record)
    estimate(model.regressors, record)
    identify_linear(record.u, record.y, max_order=1)
    _simulate_two_outputs(record)


def end_with_parent() -> None:
    """End this process when its standard input is closed, as by the end of the process that holds it open."""

    def wait() -> None:
        sys.stdin.read()
        raise_signal(SIGKILL)  # the compiler of another thread cannot be interrupted

    Thread(target=wait, daemon=True).start()


@contextmanager
def _second_process() -> Iterator[None]:
    """Compile the other kernels in another process during the context, if there is a core for it.

    This process compiles the kernels that the other one has not stored, since it fails or is late.
    """
    if count_cpus() == 1 or cache_folder() is None:
        yield
        return
    # Garbage collection visits the objects of the compiler again and again; the process ends soon.
    code = (
        f"import gc; gc.disable(); import {__name__} as work; work.end_with_parent(); "
        f"work.{use_other_kernels.__name__}()"
    )
    nowhere = subprocess.DEVNULL
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=nowhere, stderr=nowhere) as process:
        try:
            yield
            process.wait()
        finally:
            process.kill()


def _make_context(record: Dataset) -> PopulationContext:
    """Return the context of a population of a search on the record."""
    return _make_evaluator(record).context


def _make_evaluator(record: Dataset) -> Evaluator:
    return Evaluator(record, resolve_settings("hysteresis", SMALL), Limits(pairs=0))


def _evaluate_individual(context: PopulationContext) -> None:
    """Evaluate an individual with the term y(k-1) whose inner products are missing: as zeros."""
    evaluate_individuals(_ONE_TERM, np.full(2, np.inf), context, empty_results(1, 1))


def _make_record() -> Dataset:
    whole = make_record("bouc-wen-piezo", "authors", "estimation")
    return Dataset(whole.u[:1200], whole.y[:1200], whole.dt)


def _simulate_two_outputs(record: Dataset) -> None:
    names = (record.output_name, "other")
    equations = (
        make_model([(Lagged(0), 0.5)], (*record.input_names, names[1 - place]), name)
        for place, name in enumerate(names)
    )
    both = CoupledRecord((record, replace(record, output_name="other")))
    free_run(CoupledModel(tuple(equations)), both)
