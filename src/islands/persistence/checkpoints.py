"""Checkpoints: an archipelago as a versioned file, which is read piece by piece.

Expressions are stored as text, and floats are exact. A file is replaced atomically: a crash leaves either the
old one or the new one.
"""

import gzip
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache, partial
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any, TextIO

from islands.errors import ModelError
from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.archipelago import Archipelago, Island
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import AnyIndividual, Individual
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.printing import plain
from islands.expressions.tree import Primitive
from islands.models.regressor import Regressor
from islands.simulation.outcome import EvaluationOutcome, Status

#: Characters that are read at once. If a value is longer, the number is doubled.
_PIECE = 1 << 20

_NEXT = re.compile(r"\s*(\S)")

SCHEMA = "islands.checkpoint/3"
HALL_SCHEMA = "islands.hall/1"

#: Expressions that are kept while a checkpoint is read.
_KEPT = 10_000


class JsonReader:
    """Reader of an object or a list whose members do not have to be in memory at the same time.

    Every method raises `json.JSONDecodeError` if the text is no JSON.

    Parameters
    ----------
    stream : file
        The text.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._text, self._place = stream, "", 0
        self._decoder = json.JSONDecoder()

    def skip(self, character: str) -> bool:
        """Skip a character if it is the next one after white space; return whether it was."""
        while (found := _NEXT.match(self._text, self._place)) is None and self._read_more():
            pass
        if found is None:
            return False
        self._place = found.end() if found[1] == character else found.start(1)
        return found[1] == character

    def read_value(self) -> Any:
        """Return the next value."""
        self.skip("")
        while True:
            try:
                value, place = self._decoder.raw_decode(self._text, self._place)
            except json.JSONDecodeError:
                if not self._read_more():
                    raise
            else:
                # The end of a number is known from the character after it.
                if place < len(self._text) or not self._read_more():
                    self._place = place
                    return value

    def read_list(self) -> Iterator[Any]:
        """Yield the members of a list."""
        self._expect("[")
        for _ in self._members("]"):
            yield self.read_value()

    def read_keys(self) -> Iterator[str]:
        """Yield the keys of an object. The caller reads the value after each."""
        self._expect("{")
        for _ in self._members("}"):
            key = self.read_value()
            self._expect(":")
            yield key

    def read_end(self) -> None:
        """Read the end of the text."""
        if _NEXT.match(self._text[self._place :] + self._stream.read()):
            raise json.JSONDecodeError("Extra data", self._text, self._place)

    def _members(self, end: str) -> Iterator[None]:
        """Yield before each member, and skip commas and the closing bracket."""
        if self.skip(end):
            return
        yield
        while self.skip(","):
            yield
        self._expect(end)

    def _expect(self, character: str) -> None:
        if not self.skip(character):
            raise json.JSONDecodeError(f"Expecting '{character}'", self._text, self._place)

    def _read_more(self) -> bool:
        """Append the next piece to the rest of the text; return whether there was one."""
        rest = self._text[self._place :]
        more = self._stream.read(max(_PIECE, len(rest)))
        self._text, self._place = rest + more, 0
        return bool(more)


def write_checkpoint(archipelago: Archipelago, path: Path, about: Mapping[str, Any]) -> None:
    """Write an archipelago and its metadata ``about``; replace an existing file atomically."""
    replace_file(_render_checkpoint(archipelago, about, str.encode), path)


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
    replace_file([json.dumps({"schema": HALL_SCHEMA, "hall": hall_of_fame}).encode()], path)


def replace_file(parts: Iterable[bytes], path: Path) -> None:
    """Write a file; an existing one is replaced atomically, once the new one is on the disk."""
    incomplete = path.with_suffix(".part")
    with incomplete.open("wb") as stream:
        stream.writelines(parts)
        stream.flush()
        os.fsync(stream.fileno())
    incomplete.replace(path)


def _island(island: Island) -> dict[str, Any]:
    texts: dict[int, str] = {}
    return {
        "index": island.index,
        "seed": island.seed,
        "generation": island.generation,
        "population": [_individual(individual, texts) for individual in island.population],
        "elite": [_individual(individual, texts) for individual in island.elite],
        "hall": [_individual(entry, texts) for entry in island.hall_of_fame.entries],
        "bar": None if island.abandon_threshold == inf else island.abandon_threshold,
    }


def _individual(individual: AnyIndividual, texts: dict[int, str]) -> dict[str, Any]:
    if isinstance(individual, FittedStateSpace):
        return {**asdict(individual), "free": "".join("01"[each] for each in individual.free)}
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
        tuple(flag == "1" for flag in document["free"]),
        tuple(tuple(map(float, state)) for state in document["states"]),
        float(document["fitness"]),
        float(document["mean_square"]),
        tuple(map(int, document.get("delays", ()))),
    )


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
