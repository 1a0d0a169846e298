"""Writing of checkpoints and of halls of fame.

A file is replaced atomically: a crash leaves either the old one or the new one.
"""

import gzip
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.archipelago import Archipelago
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import AnyIndividual
from islands.evolution.island import Island
from islands.expressions.printing import plain

SCHEMA = "islands.checkpoint/3"
HALL_SCHEMA = "islands.hall/1"


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
        "population": [_individual(each, texts) for each in island.population],
        "elite": [_individual(each, texts) for each in island.elite],
        "hall": [_individual(each, texts) for each in island.hall_of_fame.entries],
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
