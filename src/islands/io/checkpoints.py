"""Checkpoints: an archipelago as a versioned file.

The file is replaced atomically: a crash leaves either the old checkpoint or the new one. Expressions are
stored as text, and floats are exact.
"""

import gzip
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
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
    _write(_render_checkpoint(archipelago, about, str.encode), path)


def checkpoint_text(archipelago: Archipelago, about: Mapping[str, Any]) -> str:
    """Return a checkpoint as text."""
    return b"".join(_render_checkpoint(archipelago, about, str.encode)).decode()


def compressed_checkpoint(archipelago: Archipelago, about: Mapping[str, Any]) -> Iterator[bytes]:
    """Yield the parts of a checkpoint as a gzip file: one member for each island.

    The islands are rendered and compressed where they are, see `Archipelago.render`. The decompressed text is
    that of `write_checkpoint`.
    """
    return _render_checkpoint(archipelago, about, compress_text)


def _render_checkpoint(
    archipelago: Archipelago, about: Mapping[str, Any], encode: Callable[[str], bytes]
) -> Iterator[bytes]:
    head = json.dumps({"schema": SCHEMA, "about": dict(about), "islands": []})
    yield encode(head.removesuffix("]}"))
    for number, part in enumerate(archipelago.render(partial(_render_island, encode))):
        if number:
            yield encode(", ")
        yield part
    yield encode("]}")


def _render_island(encode: Callable[[str], bytes], island: Island) -> bytes:
    return encode(json.dumps(_island(island)))


def compress_text(text: str) -> bytes:
    """Return a text as a gzip file. Equal texts have equal bytes."""
    return gzip.compress(text.encode(), compresslevel=1, mtime=0)


def write_hall(hall: HallOfFame, path: Path) -> None:
    """Write a hall of fame. The bytes do not depend on the engine or the machine that ran the search."""
    texts: dict[int, str] = {}
    hall_of_fame = [_individual(each, texts) for each in hall.entries]
    _write([json.dumps({"schema": HALL_SCHEMA, "hall": hall_of_fame}).encode()], path)


def _write(parts: Iterable[bytes], path: Path) -> None:
    incomplete = path.with_suffix(".part")
    with incomplete.open("wb") as stream:
        stream.writelines(parts)
        stream.flush()
        os.fsync(stream.fileno())
    incomplete.replace(path)


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
    texts: dict[int, str] = {}
    return {
        "index": island.index,
        "seed": island.seed,
        "generation": island.generation,
        "population": [_individual(each, texts) for each in island.population],
        "elite": [_individual(each, texts) for each in island.elite],
        "hall": [_individual(each, texts) for each in island.hall_of_fame.entries],
        "bar": None if island.abandon_threshold == inf else island.abandon_threshold,
    }


def _individual(individual: Individual, texts: dict[int, str]) -> dict[str, Any]:
    # Individuals share most of their genes. Texts are kept by id, since 0 and -0 are equal.
    for gene in individual.genes:
        if id(gene) not in texts:
            texts[id(gene)] = plain(gene, inputs=2)
    return {
        "genes": [texts[id(gene)] for gene in individual.genes],
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
