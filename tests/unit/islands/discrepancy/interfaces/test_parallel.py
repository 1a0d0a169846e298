"""What is done once is not done again, and nobody sees it by the result."""

from islands.discrepancy.interfaces.parallel import memoised_map


def test_what_is_the_same_is_done_once_and_given_back_in_its_place() -> None:
    done: list[int] = []

    def square(number: int) -> int:
        done.append(number)
        return number**2

    spread = memoised_map(map, abs)
    assert list(spread(square, [3, -1, 1, 3])) == [9, 1, 1, 9]
    assert list(spread(square, (each for each in (2, -3)))) == [4, 9]
    assert sorted(map(abs, done)) == [1, 2, 3]
    assert list(spread(square, [])) == []
