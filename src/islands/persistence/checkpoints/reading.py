"""Reading of checkpoints, island by island."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any, TextIO

from islands.errors import ModelError
from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.archipelago import Archipelago
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import AnyIndividual, Individual
from islands.evolution.island import Island
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.models.regressor import Regressor
from islands.persistence.checkpoints.json_reader import JsonReader
from islands.persistence.checkpoints.writing import SCHEMA
from islands.simulation.outcome import EvaluationOutcome, Status

#: Expressions that are kept while a checkpoint is read.
_KEPT = 10_000


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
        with path.open(encoding="utf-8") as stream:
            return read_archipelago(stream, str(path), primitives)
    except OSError as error:
        raise ModelError(f"cannot read the checkpoint {path}: {error}") from error


def archipelago_from_document(
    text: str, name: str, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> tuple[Archipelago, dict[str, Any]]:
    """Parse the text of a checkpoint; see `read_archipelago`."""
    return read_archipelago(StringIO(text), name, primitives)


def read_archipelago(
    stream: TextIO,
    name: str,
    primitives: Mapping[str, Primitive] = PRIMITIVES,
    keep: Callable[[Iterator[Island]], Sequence[Island]] = tuple,
) -> tuple[Archipelago, dict[str, Any]]:
    """Read a checkpoint island by island.

    Parameters
    ----------
    stream : file
        Text of a checkpoint.
    name : str
        Name of the checkpoint in error messages.
    primitives : mapping
        Primitives that expressions may contain.
    keep : callable
        Returns the islands of the archipelago; by default a tuple.

    Raises
    ------
    ModelError
        The checkpoint is damaged or has another version.
    OSError
        The file cannot be read.
    """
    reader, document, generations = JsonReader(stream), dict[str, Any](), set[int]()
    read_island = _IslandReader(primitives).read

    def read_islands() -> Iterator[Island]:
        for each in reader.read_list():
            island = read_island(each)
            generations.add(island.generation)
            yield island

    try:
        for key in reader.read_keys():
            if key != "islands":
                document[key] = reader.read_value()
            elif document.get("schema") == SCHEMA:
                document[key] = keep(read_islands())
            else:
                break
        else:
            reader.read_end()
        if document.get("schema") == SCHEMA:
            found = Archipelago(document["islands"]), dict(document["about"])
            if len(generations) != 1:
                raise ModelError("its islands are at different generations")
            return found
    except (ModelError, json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ModelError(f"cannot read the checkpoint {name}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"the checkpoint {name} is damaged: {error!r}") from error
    raise ModelError(f"{name} is not a checkpoint of schema {SCHEMA}")


class _IslandReader:
    """Reader of islands that parses equal texts once: most individuals consist of the same expressions."""

    def __init__(self, primitives: Mapping[str, Primitive]) -> None:
        self._parse = lru_cache(_KEPT)(partial(parse, primitives=primitives))
        self._regressor = lru_cache(_KEPT)(lambda text: Regressor(self._parse(text)))

    def read(self, document: Mapping[str, Any]) -> Island:
        population, elite, hall = (
            tuple(map(self._read_individual, document[name])) for name in ("population", "elite", "hall")
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

    def _read_individual(self, document: Mapping[str, Any]) -> AnyIndividual:
        if "genes" not in document:
            return _read_state_space(document)
        verdict, reason = document["outcome"]
        return Individual(
            tuple(map(self._parse, document["genes"])),
            tuple(map(self._regressor, document["regressors"])),
            tuple(map(float, document["theta"])),
            inf if document["fitness"] is None else float(document["fitness"]),
            EvaluationOutcome(Status[verdict], str(reason)),
        )


def _read_state_space(document: Mapping[str, Any]) -> FittedStateSpace:
    return FittedStateSpace(
        int(document["order"]),
        int(document["inputs"]),
        tuple(map(str, document["units"])),
        tuple(map(float, document["theta"])),
        tuple(each == "1" for each in document["free"]),
        tuple(tuple(map(float, each)) for each in document["states"]),
        float(document["fitness"]),
        float(document["mean_square"]),
    )
