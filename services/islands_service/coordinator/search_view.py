"""View of a running search for its owner: the front of size against error, and the last migration.

A search never reads it. Its size is bounded, because every report of progress contains it.
"""

from collections.abc import Iterable, Mapping
from math import sqrt
from time import monotonic
from typing import Any

from islands.data.channel_names import parse_channel_name
from islands.evolution.archipelago import RemoteIslands
from islands.evolution.hall_of_fame import pareto_front
from islands.evolution.individual import Individual
from islands.evolution.migration.topology import parse_topology
from islands.evolution.problem import Problem
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.models.equations import named_equation
from islands.models.narx import Model

#: Largest number of models of a front, and of characters of an equation: together less than 7 kB.
MAX_MODELS, MAX_CHARACTERS = 16, 300

#: Significant digits of the parameters, which the final estimation changes.
_DIGITS = 4

#: Largest part of the time of a job that the front may take: islands of actors have to be unpacked for it.
_FRONT_SHARE = 0.02

#: Largest number of islands whose migrations are shown.
MAX_ISLANDS = 16


class SearchFront:
    """Front of size against error of the present search of a job."""

    def __init__(self) -> None:
        self._problem: Problem | None = None
        self._best: Mapping[int, float] = {}
        self._front: list[dict[str, Any]] = []
        self._due = 0.0

    def begin(self, problem: Problem) -> None:
        """Begin with the front of another search."""
        self._problem, self._best, self._front, self._due = problem, {}, [], 0.0

    def update(self, state: SearchState) -> list[dict[str, Any]]:
        """Return the models of the front, smallest first: ``size``, ``error`` (RMS) and ``equation``.

        It is computed again only if an error has changed, and rarely if that takes long. It is empty if the
        islands are in other processes, from which they are not fetched.
        """
        best, began = state.history[-1].best, monotonic()
        is_remote = isinstance(state.archipelago.islands, RemoteIslands)
        if self._problem is None or is_remote or best == self._best or began < self._due:
            return self._front
        found = (
            entry for island in state.archipelago.islands for entry in island.hall_of_fame.best().values()
        )
        self._front = [_describe(each, self._problem) for each in _thin_out(pareto_front(found))]
        self._best, ended = best, monotonic()
        self._due = ended + (ended - began) / _FRONT_SHARE
        return self._front


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


def _thin_out(front: tuple[Individual, ...]) -> Iterable[Individual]:
    """Return at most `MAX_MODELS` models of a front, among them the first and the last one."""
    last, count = len(front) - 1, min(len(front), MAX_MODELS)
    return (front[round(at * last / max(1, count - 1))] for at in range(count))


def _describe(individual: Individual, problem: Problem) -> dict[str, Any]:
    text = _write_equation(individual, problem)
    if len(text) > MAX_CHARACTERS:
        text = f"{text[: MAX_CHARACTERS - 1]}…"
    return {"size": individual.size, "error": sqrt(individual.fitness), "equation": text}


def _write_equation(individual: Individual, problem: Problem) -> str:
    """Write the equation of a model with the names of the columns."""
    record = problem.record
    model = Model(
        individual.regressors,
        individual.theta,
        input_names=record.input_names,
        output_name=record.output_name,
    )
    names = (record.output_name, *(parse_channel_name(name).base for name in record.input_names))
    statement = ", ".join(
        f"{name} minus {offset:g}" for name, offset in zip(names, problem.offsets, strict=False) if offset
    )
    line = named_equation(model, _DIGITS)
    return f"{line}, with {statement}" if statement else line
