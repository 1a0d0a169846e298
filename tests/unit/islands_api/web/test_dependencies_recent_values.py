"""Values that are kept in memory as long as they are in use."""

from islands_api.web.dependencies import RecentValues


def test_the_value_that_was_not_used_for_the_longest_time_is_removed() -> None:
    values: RecentValues[str, int] = RecentValues(2)
    values.store("a", 1)
    values.store("b", 2)
    assert values.get("a") == 1
    values.store("c", 3)
    assert [values.get(key) for key in "abc"] == [1, None, 3]


def test_values_weigh_at_most_the_limit() -> None:
    values: RecentValues[str, str] = RecentValues(5, len)
    for key, value in (("a", "12"), ("b", "123"), ("a", "1"), ("c", "1")):
        values.store(key, value)
    assert [values.get(key) for key in "abc"] == ["1", "123", "1"]
    values.store("d", "123456")
    assert [values.get(key) for key in "abcd"] == ["1", "123", "1", None]
    values.store("d", "1234")
    assert [values.get(key) for key in "abcd"] == [None, None, "1", "1234"]
