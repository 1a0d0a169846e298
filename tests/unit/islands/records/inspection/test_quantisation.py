import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.channel import Channel
from islands.records.inspection.excitation import measure_excitation
from islands.records.inspection.quantisation import find_quantisation
from support.known_records import slow


def find(values):
    return find_quantisation(Channel("y_V", "V", values, is_output=True))


@pytest.mark.parametrize("step", [0.01, 5.0 / 4096.0, 0.3])
@pytest.mark.parametrize("offset", [0.0, 0.123])
def test_step_is_exact(step, offset):
    for seed in range(3):
        y = slow(2000, seed)
        y = offset + step * np.round(y / y.std() / step)
        assert find(y).value == pytest.approx(step, rel=1e-9)


def test_step_is_the_divisor_of_all_differences():
    assert find(np.tile([0.0, 0.4, 1.0], 20)).value == pytest.approx(0.2, rel=1e-9)


def test_a_held_excitation_has_one_count_of_levels_and_no_converter():
    force = 20.0 * np.random.default_rng(0).choice([0, 5, 19], 60).repeat(10)
    channel = Channel("force_N", "N", force, is_output=False)
    fact = find_quantisation(channel)
    assert (fact.value, fact.finding, fact.details["levels"]) == (None, "quantisation_held", 3)
    levels = measure_excitation(channel, Dataset(force, force, 1.0))[1]
    assert levels.value == 3


def test_a_staircase_and_a_converter_have_one_description():
    """Nothing tells 1, 2, 3, 4, each held for a while, from a slow ramp in a coarse lattice."""
    assert find(np.repeat([1.0, 2.0, 3.0, 4.0], 50)).value == 1.0
