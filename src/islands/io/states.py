"""Where a search stands, as a document: what a checkpoint tells besides its islands."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from islands.evolution.archipelago import Archipelago
from islands.evolution.search import State
from islands.validation.findings import Progress


def state_document(state: State) -> dict[str, Any]:
    """Describe what was counted, and the history; numbers that JSON does not know become null."""
    return {
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": history_document(state.history),
    }


def history_document(history: Sequence[Progress]) -> list[list[Any]]:
    """Describe a history: generation, evaluations, best fitness by size, best fitness by island."""
    return [
        [
            point.generation,
            point.evaluations,
            dict(point.best),
            [least if least < inf else None for least in point.islands],
        ]
        for point in history
    ]


def history_of(document: Sequence[Sequence[Any]]) -> tuple[Progress, ...]:
    """Make a history of its document."""
    return tuple(
        Progress(
            generation,
            evaluations,
            {int(size): error for size, error in best.items()},
            tuple(inf if error is None else error for error in least),
        )
        for generation, evaluations, best, least in document
    )


def state_of(archipelago: Archipelago, document: Mapping[str, Any]) -> State:
    """Make a state of its document.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        It is none.
    """
    return State(
        archipelago,
        document["evaluations"],
        document["duplicates"],
        document["outcomes"],
        history_of(document["history"]),
    )
