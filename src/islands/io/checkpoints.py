"""Checkpoints: an archipelago as a versioned file, written so that a crash leaves the old one or the new one.

Expressions are text that is read back as written; floats are exact.
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
    """Write an archipelago, and what it belongs to, in place of the file that is there."""
    _write(checkpoint_text(archipelago, about), path)


def checkpoint_text(archipelago: Archipelago, about: Mapping[str, Any]) -> str:
    """Return a checkpoint as text."""
    islands = [_island(island) for island in archipelago.islands]
    return json.dumps({"schema": SCHEMA, "about": dict(about), "islands": islands})


def write_hall(hall: HallOfFame, path: Path) -> None:
    """Write a hall of fame: the same bytes wherever and however it was found."""
    hall_of_fame = [_individual(each) for each in hall.entries]
    _write(json.dumps({"schema": HALL_SCHEMA, "hall": hall_of_fame}), path)


def _write(text: str, path: Path) -> None:
    beside = path.with_suffix(".part")
    with beside.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    beside.replace(path)


def read_checkpoint(
    path: Path, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> tuple[Archipelago, dict[str, Any]]:
    """Read an archipelago and what it belongs to.

    Raises
    ------
    ModelError
        There is no checkpoint, or it is damaged or of another version.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot read the checkpoint {path}: {error}") from error
    return archipelago_from_document(text, str(path), primitives)


def archipelago_from_document(
    text: str, name: str, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> tuple[Archipelago, dict[str, Any]]:
    """Make an archipelago of a checkpoint's text, which messages call by a name.

    Raises
    ------
    ModelError
        It is damaged or of another version.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ModelError(f"cannot read the checkpoint {name}: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ModelError(f"{name} is no checkpoint of schema {SCHEMA}")
    try:
        islands = tuple(_read_island(island, primitives) for island in document["islands"])
        if len({island.generation for island in islands}) != 1:
            raise ModelError("its islands are not at one generation")
        return Archipelago(islands), dict(document["about"])
    except (KeyError, TypeError, ValueError, AttributeError, ModelError) as error:
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
    """Describe what was counted, and the history; numbers that JSON does not know become null."""
    return {
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": history_document(state.history),
    }


def history_document(history: Sequence[HistoryPoint]) -> list[list[Any]]:
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


def history_from_document(document: Sequence[Sequence[Any]]) -> tuple[HistoryPoint, ...]:
    """Make a history of its document."""
    return tuple(
        HistoryPoint(
            generation,
            evaluations,
            {int(size): error for size, error in best.items()},
            tuple(inf if error is None else error for error in least),
        )
        for generation, evaluations, best, least in document
    )


def state_from_document(archipelago: Archipelago, document: Mapping[str, Any]) -> SearchState:
    """Make a state of its document.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        It is none.
    """
    return SearchState(
        archipelago,
        document["evaluations"],
        document["duplicates"],
        document["outcomes"],
        history_from_document(document["history"]),
    )
