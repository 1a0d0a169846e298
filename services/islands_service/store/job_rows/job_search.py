"""Search in the jobs of an owner: by tag, by words of the labels and of the result, and by error.

The texts are folded by Python, since the databases fold only ASCII (SQLite) or by their locale (PostgreSQL).
"""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any
from unicodedata import normalize

from sqlalchemy import ColumnElement, or_

from islands_service.store.backends.dialect import position
from islands_service.store.tables import jobs

#: Entries of a summary by which a result is found: a model, a diagnosis, a record of a monitor.
_RESULT = ("equation", "simulation", "verdict", "effects", "status")


def join_tags(tags: Iterable[str]) -> str:
    """Return tags as the text of their column, without repetitions: ``,a,b,``."""
    different = tuple(dict.fromkeys(tags))
    return f",{','.join(different)}," if different else ""


def split_tags(text: str) -> tuple[str, ...]:
    """Return the tags of the text of their column."""
    return tuple(filter(None, text.split(",")))


def fold(text: str) -> str:
    """Return a text in which equal words are equal in every case and every form of their accents."""
    return normalize("NFKC", text).casefold()


def describe_labels(name: str, tags: str, dataset_name: str | None) -> str:
    """Return the text by which a search finds a job from its submission on, given the text of its tags."""
    return fold("\n".join([name, *split_tags(tags), dataset_name or ""]))


def describe_result(summary: Mapping[str, Any] | None) -> str:
    """Return the text by which a search finds the result of a job; empty without one."""
    entries = [(summary or {}).get(name) for name in _RESULT]
    texts = [each for entry in entries for each in (entry if isinstance(entry, list) else [entry])]
    return fold("\n".join(str(text) for text in texts if text))


def find_error(summary: Mapping[str, Any] | None) -> float | None:
    """Return the error of the recommended model in per cent of the range of its output; None without one."""
    error = ((summary or {}).get("metrics") or {}).get("mape")
    return error if isinstance(error, float) and isfinite(error) else None


def has_tag(tag: str) -> ColumnElement[bool]:
    """Return the condition that a job has a tag."""
    return position(jobs.c.tags, f",{tag},") > 0


def has_words(words: Sequence[str]) -> list[ColumnElement[bool]]:
    """Return the conditions that a job has each of some words, anywhere in its labels or its result."""
    return [
        or_(position(jobs.c.search_labels, word) > 0, position(jobs.c.search_result, word) > 0)
        for word in map(fold, words)
    ]
