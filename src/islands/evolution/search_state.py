"""State of a search: the archipelago and the statistics since its beginning."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf

from islands.evolution.archipelago import Archipelago, Island
from islands.evolution.engine import ArchipelagoEpoch, Caches
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.settings import Settings


@dataclass(frozen=True, slots=True)
class HistoryPoint:
    """Best fitness at one generation.

    Attributes
    ----------
    generation : int
    evaluations : int
        Individuals evaluated up to this generation.
    best : mapping
        Best fitness (mean squared shooting error) of every model size.
    islands : tuple of float
        Best fitness of every island; infinite if the island has no model yet.
    """

    generation: int
    evaluations: int
    best: Mapping[int, float]
    islands: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SearchState:
    """State of a search. Callbacks receive it, and a checkpoint stores it.

    Attributes
    ----------
    archipelago : Archipelago
    evaluations : int
        Individuals evaluated.
    duplicates : int
        Individuals whose structure occurs among the parents or earlier in their generation.
    outcomes : mapping
        Number of individuals by outcome.
    history : tuple of HistoryPoint
        Best fitness by generation. Of consecutive points with equal fitness only the first and the last are
        kept, so that the history of a long run stays short.
    caches : mapping
        Bytes in use and byte limit of each cache, by name.
    earlier : tuple of SearchState
        Searches of the outputs before this one; empty for one output.
    """

    archipelago: Archipelago
    evaluations: int = 0
    duplicates: int = 0
    outcomes: Mapping[str, int] = field(default_factory=dict)
    history: tuple[HistoryPoint, ...] = ()
    caches: Caches = field(default_factory=dict)
    earlier: tuple["SearchState", ...] = ()


def advance(state: SearchState, epoch: ArchipelagoEpoch) -> SearchState:
    """Return the state after an epoch."""
    evaluations, duplicates = state.evaluations, state.duplicates
    outcomes, history = Counter(state.outcomes), list(state.history)
    for generation in zip(*epoch.steps, strict=True):
        evaluations += sum(info.evaluations for info in generation)
        duplicates += sum(info.duplicates for info in generation)
        best: dict[int, float] = {}
        for info in generation:
            outcomes.update(info.outcomes)
            for size, fitness in info.best.items():
                best[size] = min(fitness, best.get(size, inf))
        least = tuple(min(info.best.values(), default=inf) for info in generation)
        point = HistoryPoint(generation[0].generation, evaluations, dict(sorted(best.items())), least)
        if all(_has_equal_fitness(point, before) for before in history[-2:]) and len(history) > 1:
            history.pop()
        history.append(point)
    return SearchState(
        epoch.archipelago, evaluations, duplicates, dict(outcomes), tuple(history), epoch.caches
    )


def _has_equal_fitness(one: HistoryPoint, other: HistoryPoint) -> bool:
    return one.best == other.best and one.islands == other.islands


def sum_searches(state: SearchState) -> SearchState:
    """Return the state with the evaluations and the history of the searches before it as well.

    The generations of a search follow those of the search before it.
    """
    history: list[HistoryPoint] = []
    generation = evaluations = 0
    for search in (*state.earlier, state):
        history += [
            replace(
                point,
                generation=generation + point.generation,
                evaluations=evaluations + point.evaluations,
            )
            for point in search.history
        ]
        generation += search.history[-1].generation + 1
        evaluations += search.evaluations
    return replace(state, history=tuple(history), evaluations=evaluations)


def keep_hall(state: SearchState) -> SearchState:
    """Return the state of a search that has ended without its populations, which nothing reads any more."""
    first, *others = state.archipelago.islands
    kept = Island(first.index, first.seed, first.generation, (), (), state.archipelago.hall_of_fame)
    empty = [Island(each.index, each.seed, each.generation, (), (), HallOfFame()) for each in others]
    return replace(state, archipelago=Archipelago((kept, *empty)))


def stop_reason(state: SearchState, settings: Settings) -> str:
    """Return the budget that a search has used up; empty if none."""
    reached = state.history[-1].generation if state.history else state.archipelago.generation
    if reached >= settings.generations:
        return "generations"
    if 0 < settings.max_evaluations <= state.evaluations:
        return "evaluations"
    if state.history and min(state.history[-1].islands) ** 0.5 <= settings.target_error > 0.0:
        return "target error"
    return ""
