"""Models that are identified once for each record, whichever fit of the record needs them first."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

from islands.records.dataset import Dataset

M = TypeVar("M")
P = ParamSpec("P")

#: Identifies the models of a record, given what receives its progress.
Identification = Callable[Concatenate[Dataset, P], list[M]]


def share_models(identify: Identification[P, M]) -> Identification[P, M]:
    """Return an identification that remembers the models of the last four records."""

    @lru_cache(maxsize=4)
    def find_known(_record: Dataset) -> list[M]:
        return []

    @wraps(identify)
    def find(record: Dataset, /, *args: P.args, **options: P.kwargs) -> list[M]:
        known = find_known(record)
        if not known:
            known += identify(record, *args, **options)
        return known

    return find
