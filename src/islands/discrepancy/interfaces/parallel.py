"""Work that may be done side by side: a function of each of some arguments, in their order."""

from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Protocol, TypeVar

A = TypeVar("A")
R = TypeVar("R")


class ParallelMap(Protocol):
    """Calls a function with each of some arguments; yields what it returns in their order, as `map` does.

    `map` itself is one. Others do it on several cores: the result is the same.
    """

    def __call__(self, function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        """Call it."""


def memoised_map(spread: ParallelMap, same: Callable[[A], Hashable]) -> ParallelMap:
    """Return a spread that remembers what came of its arguments; what is the ``same`` is not done again.

    For calls of one function, or of some that return the same.
    """
    known: dict[Hashable, object] = {}

    def remembering(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        asked = [(same(each), each) for each in arguments]
        new = {key: each for key, each in asked if key not in known}
        known.update(zip(new, spread(function, new.values()), strict=True))
        return (known[key] for key, _ in asked)  # type: ignore[misc]

    return remembering  # type: ignore[return-value]
