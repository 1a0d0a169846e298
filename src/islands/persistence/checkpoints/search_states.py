"""Search states as JSON values: counters and history."""

import json
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from islands.evolution.archipelago import Archipelago
from islands.evolution.history import HistoryPoint
from islands.evolution.search_state import SearchState
from islands.persistence.checkpoints.reading import archipelago_from_document
from islands.persistence.checkpoints.writing import checkpoint_text


def state_document(state: SearchState) -> dict[str, Any]:
    """Return a search without its archipelago as JSON values; infinite fitnesses become null.

    Searches of earlier outputs are stored with their archipelagos.
    """
    return {
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": history_document(state.history),
        **({"earlier": [_search_document(each) for each in state.earlier]} if state.earlier else {}),
    }


def _search_document(state: SearchState) -> dict[str, Any]:
    text = checkpoint_text(state.archipelago, state_document(state))
    return dict(json.loads(text))


def _search_from_document(document: Mapping[str, Any]) -> SearchState:
    archipelago, about = archipelago_from_document(json.dumps(document), "of an earlier output")
    return state_from_document(archipelago, about)


def history_document(history: Sequence[HistoryPoint]) -> list[list[Any]]:
    """Return a history as lists: generation, evaluations, best fitness by size, best fitness by island."""
    return [
        [
            point.generation,
            point.evaluations,
            dict(point.best),
            [fitness if fitness < inf else None for fitness in point.islands],
        ]
        for point in history
    ]


def history_from_document(document: Sequence[Sequence[Any]]) -> tuple[HistoryPoint, ...]:
    """Make a history from the lists that `history_document` returns."""
    return tuple(
        HistoryPoint(
            generation,
            evaluations,
            {int(size): error for size, error in best.items()},
            tuple(inf if fitness is None else fitness for fitness in by_island),
        )
        for generation, evaluations, best, by_island in document
    )


def state_from_document(archipelago: Archipelago, document: Mapping[str, Any]) -> SearchState:
    """Make a search state from the document that `state_document` returns.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError, ModelError
        The document does not describe a search state.
    """
    return SearchState(
        archipelago,
        document["evaluations"],
        document["duplicates"],
        document["outcomes"],
        history_from_document(document["history"]),
        earlier=tuple(map(_search_from_document, document.get("earlier", ()))),
    )
