"""Limits of the inspection of an upload."""

from hypothesis import given
from hypothesis import strategies as st

from islands_service.intake.inspection_limits import count_slots, find_limits
from islands_service.settings import ServiceSettings

SETTINGS = ServiceSettings()


def test_a_file_of_two_megabytes_unpacks_to_two_hundred():
    """A gigabyte, the most that any file may have, would take its reader a minute."""
    limits = find_limits(2_000_000, SETTINGS)
    assert limits.unpacked == 200_000_000
    assert limits.memory < 3_000_000_000
    assert limits.slots == 4


@given(st.integers(0, 10**10), st.integers(1, 10**10), st.integers(1, 10**11))
def test_no_file_exceeds_the_settings_and_a_larger_one_has_no_less(received, most, memory):
    settings = SETTINGS.model_copy(update={"max_unpacked": most, "inspection_memory": memory})
    small, large = find_limits(received, settings), find_limits(2 * received, settings)
    assert small.unpacked <= large.unpacked <= most
    assert small.memory <= large.memory <= memory
    assert 1 <= small.slots <= large.slots <= count_slots(most)
