"""Where a search stands: the archipelago, and what was counted on the way to it."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Caches
from islands.evolution.history import HistoryPoint
from islands.evolution.settings import Settings


@dataclass(frozen=True, slots=True)
class SearchState:
    """Where a search stands: what a watcher sees, and all that a checkpoint needs.

    Attributes
    ----------
    archipelago : Archipelago
    evaluations, duplicates : int
        Since the beginning.
    outcomes : mapping
        Number of individuals by outcome.
    history : tuple of HistoryPoint
        The first and the last point of every stretch in which nothing got better: a thousand islands go on
        for a hundred thousand generations.
    caches : mapping
        Bytes that every cache takes, and its limit.
    """

    archipelago: Archipelago
    evaluations: int = 0
    duplicates: int = 0
    outcomes: Mapping[str, int] = field(default_factory=dict)
    history: tuple[HistoryPoint, ...] = ()
    caches: Caches = field(default_factory=dict)


def advance(state: SearchState, epoch: ArchipelagoEpoch) -> SearchState:
    """Return the state after one more epoch."""
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
        if all(_alike(point, before) for before in history[-2:]) and len(history) > 1:
            history.pop()
        history.append(point)
    return SearchState(
        epoch.archipelago, evaluations, duplicates, dict(outcomes), tuple(history), epoch.caches
    )


def _alike(one: HistoryPoint, other: HistoryPoint) -> bool:
    return one.best == other.best and one.islands == other.islands


def stop_reason(state: SearchState, settings: Settings) -> str:
    """Return the budget that a search has used up, "" where it has to go on."""
    reached = state.history[-1].generation if state.history else state.archipelago.generation
    if reached >= settings.generations:
        return "generations"
    if 0 < settings.max_evaluations <= state.evaluations:
        return "evaluations"
    if state.history and min(state.history[-1].islands) ** 0.5 <= settings.target_error > 0.0:
        return "target error"
    return ""
