"""Memoised map: equal keys are evaluated once, and results keep the order of the arguments."""

from types import FunctionType

from islands.parallel import memoised_map


def test_memoised_map_evaluates_each_key_once_and_keeps_the_order() -> None:
    evaluated: list[int] = []

    def square(number: int) -> int:
        evaluated.append(number)
        return number**2

    parallel_map = memoised_map(map, FunctionType, lambda _, number: abs(number))
    assert list(parallel_map(square, [3, -1, 1, 3])) == [9, 1, 1, 9]
    assert list(parallel_map(square, (each for each in (2, -3)))) == [4, 9]
    assert sorted(map(abs, evaluated)) == [1, 2, 3]
    assert list(parallel_map(square, [])) == []
    assert list(parallel_map(abs, [3, -1])) == [3, 1]  # not of the type that is cached
