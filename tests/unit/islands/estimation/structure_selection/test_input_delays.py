"""Dead times of a candidate library: inputs are read later, and the output is not."""

import pytest
from pydantic import TypeAdapter, ValidationError

from islands.errors import SettingsError
from islands.estimation.structure_selection.input_delays import Delays, delay_inputs, expand_delays
from islands.models.candidate_library import LIBRARIES, candidates


@pytest.mark.parametrize("name", LIBRARIES)
def test_dead_times_move_the_lags_of_inputs_only(name):
    before = candidates(name, 2, 2, 2)
    after = delay_inputs(before, (3, 5))
    moved = {
        tuple(sorted((channel, lag + (0, 3, 5)[channel]) for channel, lag in item.lags)) for item in before
    }
    assert len(after) == len(before)
    assert {tuple(sorted(item.lags)) for item in after} == moved


def test_one_dead_time_applies_to_all_inputs():
    assert expand_delays((), 2) == (0, 0)
    assert expand_delays((4,), 3) == (4, 4, 4)
    assert expand_delays((4, 1), 2) == (4, 1)
    with pytest.raises(SettingsError, match="one for each of the 3 inputs"):
        expand_delays((4, 1), 3)


@pytest.mark.parametrize("delay", [-1, 1001])
def test_dead_times_out_of_range_are_refused(delay):
    with pytest.raises(ValidationError, match="than or equal to"):
        TypeAdapter(Delays).validate_python([delay])
