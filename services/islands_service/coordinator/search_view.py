"""View of a running search for its owner: the front of size against error, and the last migration.

A search never reads it. Its size is bounded, because every report of progress contains it. The free run of
the best model is larger, and is stored once.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import inf, sqrt
from time import monotonic
from typing import Any, TypeVar

import structlog

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.engine import SearchProblem
from islands.evolution.individual import AnyIndividual, AnyPopulation
from islands.evolution.migration import parse_topology
from islands.evolution.search_result import SearchResult
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.models.equations import named_equation
from islands.models.form import name_form
from islands.models.latent import LatentModel
from islands.models.narx import require_narx
from islands.records.channel_names import parse_channel_name
from islands.records.input_lead import advance_all_inputs
from islands_service.domain.free_runs import SearchFreeRun, simulate_searched
from islands_service.runtime import ClusterError

log = structlog.get_logger()

M = TypeVar("M")

#: Largest number of models of a front, and of characters of an equation: together less than 7 kB.
MAX_MODELS, MAX_CHARACTERS = 16, 300

#: Significant digits of the parameters, which the final estimation changes.
_DIGITS = 4

#: Largest part of the time of a job that the front and the free run may take: islands of actors have to be
#: unpacked for it, and long records simulated.
_SHARE = 0.01

#: Error of the model that is simulated, relative to the least error, at most.
_SHOWN_RATIO = 1.1

#: Largest number of islands whose migrations are shown.
MAX_ISLANDS = 16


class SearchFront:
    """Front of size against error of the present search of a job, and the free run of its best model.

    Attributes
    ----------
    free_run : SearchFreeRun or None
        Free run of the smallest model whose error is near the least one; None before the first front.
    """

    def __init__(self) -> None:
        self._problem: SearchProblem | None = None
        self._best: Mapping[int, float] = {}
        self._front: list[dict[str, Any]] = []
        self._due = 0.0
        self._is_first = True
        self.free_run: SearchFreeRun | None = None

    def begin(self, problem: SearchProblem) -> None:
        """Begin with the front of another search."""
        self._problem, self._best, self._front, self._due = problem, {}, [], 0.0
        self._is_first, self.free_run = True, None

    def update(self, state: SearchState) -> list[dict[str, Any]]:
        """Return the models of the front, smallest first: ``size``, ``error`` (RMS) and ``equation``.

        It is computed again only if an error has changed, and rarely if that takes long, together with the
        free run. If islands of a cluster are lost, it remains: the search itself handles the loss.
        """
        best, began = state.history[-1].best, monotonic()
        if self._problem is None or best == self._best or began < self._due:
            return self._front
        try:
            front = state.archipelago.find_front()
        except ClusterError as error:
            log.warning("front not updated", reason=str(error))
        else:
            self._best, self._front = best, [_describe(each, self._problem) for each in _thin_out(front)]
            if front:
                generation = state.history[-1].generation
                self.free_run = _simulate(_find_small(front), self._problem, generation)
        ended = monotonic()
        # The first free run also loads compiled kernels, which takes longer than many later ones.
        self._due = 0.0 if self._is_first else ended + (ended - began) / _SHARE
        self._is_first = False
        return self._front


def describe_fits(found: SearchResult) -> list[dict[str, Any]]:
    """Return the front of the fits before a search, as `SearchFront.update` does that of the search.

    Parameters
    ----------
    found : SearchResult
        All models so far. Their errors are those of the free run on the estimation data.
    """
    front: list[dict[str, Any]] = []
    least = inf
    errors = [(each.model, each.metrics["estimation"]["free_run"].rmse) for each in found.models]
    for model, error in sorted(errors, key=lambda each: (each[0].free_size, each[1])):
        if error < least:
            least = error
            text = model.equation().named
            if isinstance(model, LatentModel):
                text = f"{name_form(model)}, {model.structure}"
            front.append({"size": model.free_size, "error": error, "equation": _shorten(text)})
    return list(_thin_out(front))


def _find_small(front: AnyPopulation) -> AnyIndividual:
    """Return the smallest model whose error is near the least one."""
    most = _SHOWN_RATIO**2 * min(model.fitness for model in front)
    return next(model for model in front if model.fitness <= most)


def _simulate(individual: AnyIndividual, problem: SearchProblem, generation: int) -> SearchFreeRun:
    offset = problem.offsets[0] if problem.offsets else 0.0
    model, record = problem.make_model(individual), problem.record
    if model.input_names != record.input_names:
        record = advance_all_inputs(record)
    error = sqrt(individual.fitness)
    return simulate_searched(model, individual.size, record, offset, generation, error)


def describe_migration(state: SearchState, settings: Settings, seed: int) -> dict[str, Any] | None:
    """Describe the last migration of a search; None before it, and for one island or too many islands.

    Returns
    -------
    dict or None
        ``generation`` of the migration, largest number of ``emigrants`` on each way, and ``sources``: for
        every island, the islands whose emigrants it received.
    """
    generation = state.archipelago.generation
    if not 1 < settings.islands <= MAX_ISLANDS:
        return None
    while generation > 0 and not settings.stops.stops_at(generation):
        generation -= 1
    sources = parse_topology(settings.topology, settings.islands, seed).sources
    emigrants = settings.leaving.at(max(0, generation))
    if generation <= 0 or emigrants == 0 or not any(sources):
        return None
    return {"generation": generation, "emigrants": emigrants, "sources": [list(each) for each in sources]}


def _thin_out(front: Sequence[M]) -> Iterable[M]:
    """Return at most `MAX_MODELS` models of a front, among them the first and the last one."""
    last, count = len(front) - 1, min(len(front), MAX_MODELS)
    return (front[round(at * last / max(1, count - 1))] for at in range(count))


def _describe(individual: AnyIndividual, problem: SearchProblem) -> dict[str, Any]:
    text = _shorten(_write_equation(individual, problem))
    return {"size": individual.size, "error": sqrt(individual.fitness), "equation": text}


def _shorten(equation: str) -> str:
    return equation if len(equation) <= MAX_CHARACTERS else f"{equation[: MAX_CHARACTERS - 1]}…"


def _write_equation(individual: AnyIndividual, problem: SearchProblem) -> str:
    """Write the equation of a model with the names of the columns, or the structure of a state space."""
    if isinstance(individual, FittedStateSpace):
        return _describe_structure(individual)
    record, model = problem.record, require_narx(problem.make_model(individual))
    names = (record.output_name, *(parse_channel_name(name).base for name in record.input_names))
    statement = ", ".join(
        f"{name} minus {offset:g}" for name, offset in zip(names, problem.offsets, strict=False) if offset
    )
    line = named_equation(model, _DIGITS)
    return f"{line}, with {statement}" if statement else line


def _describe_structure(system: FittedStateSpace) -> str:
    """Describe a state space, whose equations are too long: ``2 states with cube, 2 × tanh``."""
    states = "1 state" if system.order == 1 else f"{system.order} states"
    counts = Counter(sorted(system.units)).items()
    units = ", ".join(unit if count == 1 else f"{count} × {unit}" for unit, count in counts)
    return f"{states} with {units}" if units else f"{states}, linear"
