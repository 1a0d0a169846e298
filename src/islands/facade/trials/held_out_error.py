"""Trial of a candidate library: free-run errors of small models on held-out parts of the estimation data."""

from collections.abc import Iterator, Sequence
from math import inf

from islands.available_cpus import count_cpus
from islands.errors import IslandsError
from islands.estimation.estimate import estimate
from islands.estimation.forward_selection import (
    Structure,
    make_selection_problem,
    select_forward,
    select_pool,
)
from islands.estimation.structure_selection.deviations import find_offsets, subtract_offsets
from islands.evolution.evaluation import Evaluator
from islands.evolution.swap_search import swap_search
from islands.facade.trials.library import TrialLibrary
from islands.models.regressor import Regressor
from islands.progress import Steps, StoppedError
from islands.records.dataset import Dataset, join
from islands.records.split import Split
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run_error

#: Part of the record that is held out, at its end and at its start in turn.
_HELD_OUT = 0.3

#: Samples of a trial, at most, and number of parts of a longer record that contain them.
_SAMPLES, _PARTS = 20_000, 4

#: Terms of the models of forward selection, and of the swap search, at most.
_FORWARD_TERMS, _SWAP_TERMS = 10, 6

#: Structures of each size of the swap search that are simulated.
_DEPTH = 3

#: Name of the step in an error.
_STEP = "trial of a library"

#: Samples of a shooting interval, at most a tenth of the record.
_SHOOTING = 500


def hold_out(record: Dataset) -> tuple[Split, Split]:
    """Return two splits of a record, which hold out its end and its start.

    A long record is replaced by parts at equal distances.
    """
    if record.samples > _SAMPLES:
        length = _SAMPLES // _PARTS
        starts = [part * (record.samples - length) // (_PARTS - 1) for part in range(_PARTS)]
        record = join(tuple(record[start : start + length] for start in starts))
    held = max(1, round(_HELD_OUT * record.samples))
    return Split(record[:-held], record[-held:]), Split(record[held:], record[:held])


def measure_library(
    splits: Sequence[Split], library: TrialLibrary, steps: Steps | None = None
) -> tuple[float, ...]:
    """Return the root mean squared error of the best model of each held-out part.

    It is infinite if no model can be estimated and simulated, for example because a part is too short.

    Parameters
    ----------
    splits : sequence of Split
        Estimation data, and a held-out part as validation data.
    library : TrialLibrary
    steps : Steps, optional
        Checked between the estimations.

    Raises
    ------
    StoppedError
        A stop is requested.
    """
    checked = steps or Steps()
    return tuple(_find_least_error(split, library, checked) ** 0.5 for split in splits)


def _find_least_error(split: Split, library: TrialLibrary, steps: Steps) -> float:
    """Return the least mean squared error of the free runs of the models; infinite if all diverge."""
    least = inf
    try:
        steps.check(_STEP)
        offsets = find_offsets(split.estimation, library.constraints)
        estimation, held = (subtract_offsets(part, offsets) for part in (split.estimation, split.validation))
        pool = library.screen(estimation)
        warm_up = max(item.maximum_lag for item in pool)
        for structure in _select(pool, estimation, library, steps):
            steps.check(_STEP)
            found = estimate(structure, estimation, library.constraints, warm_up, standard_errors=False)
            if not isinstance(found, EvaluationOutcome):
                model = found.model
                error = free_run_error(model.regressors, model.parameters, held, warm_up, least)
                least = min(least, error)
    except StoppedError:
        raise
    except IslandsError:
        pass  # The search with this library reports what is wrong.
    return least


def _select(
    pool: Sequence[Regressor], record: Dataset, library: TrialLibrary, steps: Steps
) -> Iterator[Structure]:
    """Yield the structures of a forward selection, and those of a swap search that starts from them."""
    problem = make_selection_problem(pool, record, library.constraints)
    if isinstance(problem, EvaluationOutcome):
        return
    structures = select_forward(problem, _FORWARD_TERMS)
    yield from structures
    shooting = min(_SHOOTING, max(1, record.samples // 10))
    by_size = swap_search(
        Evaluator(record, library.make_settings(_SWAP_TERMS, shooting), threads=count_cpus()),
        [item.expression for item in select_pool(pool, problem, _SWAP_TERMS)],
        [
            tuple(item.expression for item in structure)
            for structure in structures
            if len(structure) <= _SWAP_TERMS
        ],
        depth=_DEPTH,
        steps=Steps(stop=steps.stop),
    )
    for individuals in by_size:
        yield from (each.regressors for each in individuals)
