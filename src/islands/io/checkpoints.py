"""Checkpoints: an archipelago as a versioned file.

The file is replaced atomically: a crash leaves either the old checkpoint or the new one. Expressions are
stored as text, and floats are exact.
"""

import json
import os
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.evolution.archipelago import Archipelago
from islands.evolution.gp.individual import Individual
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.history import HistoryPoint
from islands.evolution.island import Island
from islands.evolution.search_state import SearchState
from islands.model.expression import Primitive
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES
from islands.model.regressor import Regressor
from islands.model.rendering import plain
from islands.simulation.outcome import EvaluationOutcome, Status

SCHEMA = "islands.checkpoint/3"
HALL_SCHEMA = "islands.hall/1"


def write_checkpoint(archipelago: Archipelago, path: Path, about: Mapping[str, Any]) -> None:
    """Write an archipelago and its metadata ``about``; replace an existing file atomically."""
    _write(checkpoint_text(archipelago, about), path)


def checkpoint_text(archipelago: Archipelago, about: Mapping[str, Any]) -> str:
    """Return a checkpoint as text."""
    islands = [_island(island) for island in archipelago.islands]
    return json.dumps({"schema": SCHEMA, "about": dict(about), "islands": islands})


def write_hall(hall: HallOfFame, path: Path) -> None:
    """Write a hall of fame. The bytes do not depend on the engine or the machine that ran the search."""
    hall_of_fame = [_individual(each) for each in hall.entries]
    _write(json.dumps({"schema": HALL_SCHEMA, "hall": hall_of_fame}), path)


def _write(text: str, path: Path) -> None:
    partial = path.with_suffix(".part")
    with partial.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    partial.replace(path)


def read_checkpoint(
    path: Path, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> tuple[Archipelago, dict[str, Any]]:
    """Read an archipelago and its metadata.

    Raises
    ------
    ModelError
        The checkpoint does not exist, is damaged or has another version.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot read the checkpoint {path}: {error}") from error
    return archipelago_from_document(text, str(path), primitives)


def archipelago_from_document(
    text: str, name: str, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> tuple[Archipelago, dict[str, Any]]:
    """Parse the text of a checkpoint.

    Parameters
    ----------
    text : str
        Content of a checkpoint file.
    name : str
        Name of the checkpoint in error messages.
    primitives : mapping
        Primitives that expressions may contain.

    Raises
    ------
    ModelError
        The checkpoint is damaged or has another version.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ModelError(f"cannot read the checkpoint {name}: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ModelError(f"{name} is not a checkpoint of schema {SCHEMA}")
    try:
        islands = tuple(_read_island(island, primitives) for island in document["islands"])
        if len({island.generation for island in islands}) != 1:
            raise ModelError("its islands are at different generations")
        return Archipelago(islands), dict(document["about"])
    except ModelError as error:
        raise ModelError(f"cannot read the checkpoint {name}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"the checkpoint {name} is damaged: {error!r}") from error


def _island(island: Island) -> dict[str, Any]:
    return {
        "index": island.index,
        "seed": island.seed,
        "generation": island.generation,
        "population": [_individual(each) for each in island.population],
        "elite": [_individual(each) for each in island.elite],
        "hall": [_individual(each) for each in island.hall_of_fame.entries],
        "bar": None if island.abandon_threshold == inf else island.abandon_threshold,
    }


def _individual(individual: Individual) -> dict[str, Any]:
    return {
        "genes": [plain(gene, inputs=2) for gene in individual.genes],
        "regressors": [item.text for item in individual.regressors],
        "theta": list(individual.theta),
        "fitness": None if individual.fitness == inf else individual.fitness,
        "outcome": [individual.outcome.verdict.name, individual.outcome.reason],
    }


def _read_island(document: Mapping[str, Any], primitives: Mapping[str, Primitive]) -> Island:
    population, elite, hall = (
        tuple(_read_individual(each, primitives) for each in document[name])
        for name in ("population", "elite", "hall")
    )
    return Island(
        int(document["index"]),
        int(document["seed"]),
        int(document["generation"]),
        population,
        elite,
        HallOfFame(hall),
        inf if document["bar"] is None else float(document["bar"]),
    )


def _read_individual(document: Mapping[str, Any], primitives: Mapping[str, Primitive]) -> Individual:
    verdict, reason = document["outcome"]
    return Individual(
        tuple(parse(text, primitives) for text in document["genes"]),
        tuple(Regressor(parse(text, primitives)) for text in document["regressors"]),
        tuple(map(float, document["theta"])),
        inf if document["fitness"] is None else float(document["fitness"]),
        EvaluationOutcome(Status[verdict], str(reason)),
    )


def state_document(state: SearchState) -> dict[str, Any]:
    """Return the counters and the history of a search as JSON values; infinite fitnesses become null."""
    return {
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": history_document(state.history),
    }


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
    KeyError, TypeError, ValueError, AttributeError
        The document does not describe a search state.
    """
    return SearchState(
        archipelago,
        document["evaluations"],
        document["duplicates"],
        document["outcomes"],
        history_from_document(document["history"]),
    )
