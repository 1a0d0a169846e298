"""Values that are kept in memory as long as they are in use."""

from islands_api.web.recent_values import RecentValues


def test_the_value_that_was_not_used_for_the_longest_time_is_removed() -> None:
    values: RecentValues[str, int] = RecentValues(2)
    values.store("a", 1)
    values.store("b", 2)
    assert values.get("a") == 1
    values.store("c", 3)
    assert [values.get(key) for key in "abc"] == [1, None, 3]


def test_a_value_is_replaced() -> None:
    values: RecentValues[str, int] = RecentValues(2)
    values.store("a", 1)
    values.store("a", 2)
    assert values.get("a") == 2
