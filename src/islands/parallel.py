"""Parallel map: a function applied to each of several arguments, with the results in order."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from functools import wraps
from typing import Any, Protocol, TypeVar, cast

from islands.available_cpus import count_cpus

#: Samples from which a record is long: its kernels then take longer than the Python code around them.
_LONG = 10_000

A = TypeVar("A")
F = TypeVar("F", bound=Callable[..., Any])
R = TypeVar("R")


class ParallelMap(Protocol):
    """Apply a function to each argument and yield the results in the order of the arguments, like `map`.

    The built-in `map` is one implementation. Others use several cores and give the same results.
    """

    def __call__(self, function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        """Apply the function to each argument."""


def one_blas_thread(function: F) -> F:
    """Return a function during which the library of matrix products has one thread.

    The sums of a product depend on the number of threads, and the matrices are mostly small: several threads
    take a quarter more of CPU time and no less time.
    """

    @wraps(function)
    def limited(*args: Any, **options: Any) -> Any:
        from threadpoolctl import threadpool_limits  # noqa: PLC0415 - every command imports this module

        with threadpool_limits(1, user_api="blas"):
            return function(*args, **options)

    return cast("F", limited)


def map_over_record(function: Callable[[A], R], arguments: Iterable[A], samples: int) -> Iterator[R]:
    """Apply a function that simulates a record to each argument, in threads if the record is long.

    The results come in the order of the arguments. Threads use several cores, since kernels release the GIL.

    Parameters
    ----------
    function : callable
        Its result depends on its argument alone.
    arguments : iterable
    samples : int
        Length of the record.
    """
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - every command imports this module

    threads = count_cpus()
    if samples < _LONG or threads == 1:
        yield from map(function, arguments)
        return
    with ThreadPoolExecutor(threads) as executor:
        yield from executor.map(function, arguments)


def intercepted_map(
    parallel_map: ParallelMap, kind: type[F], compute: Callable[[F, Sequence[Any]], Iterable[Any]]
) -> ParallelMap:
    """Return a map that leaves the calls of functions of one type to ``compute(function, arguments)``."""

    def map_or_compute(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        if isinstance(function, kind):
            return iter(compute(function, list(arguments)))
        return parallel_map(function, arguments)

    return map_or_compute


def memoised_map(parallel_map: ParallelMap, kind: type, key: Callable[[Any, Any], Hashable]) -> ParallelMap:
    """Return a map that caches the results of functions of one type by a key of function and argument.

    Calls with equal keys must have equal results.
    """
    results: dict[Hashable, Any] = {}

    def take(function: Callable[[Any], Any], arguments: Sequence[Any]) -> Iterable[Any]:
        keyed = [(key(function, argument), argument) for argument in arguments]
        missing = {each: argument for each, argument in keyed if each not in results}
        results.update(zip(missing, parallel_map(function, missing.values()), strict=True))
        return (results[each] for each, _ in keyed)

    return intercepted_map(parallel_map, kind, take)
