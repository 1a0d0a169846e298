"""Parallel map: a function applied to each of several arguments, with the results in order."""

from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Any, Protocol, TypeVar

A = TypeVar("A")
R = TypeVar("R")


class ParallelMap(Protocol):
    """Apply a function to each argument and yield the results in the order of the arguments, like `map`.

    The built-in `map` is one implementation. Others use several cores and give the same results.
    """

    def __call__(self, function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        """Apply the function to each argument."""


def memoised_map(parallel_map: ParallelMap, kind: type, key: Callable[[Any, Any], Hashable]) -> ParallelMap:
    """Return a map that caches the results of functions of one type by a key of function and argument.

    Calls with equal keys must have equal results.
    """
    results: dict[Hashable, Any] = {}

    def cached_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        if not isinstance(function, kind):
            return parallel_map(function, arguments)
        keyed = [(key(function, argument), argument) for argument in arguments]
        missing = {each: argument for each, argument in keyed if each not in results}
        results.update(zip(missing, parallel_map(function, missing.values()), strict=True))
        return (results[each] for each, _ in keyed)

    return cached_map
