import numpy as np
import pytest

from islands.records.inspection.channel import Channel
from islands.records.inspection.quantisation import find_quantisation
from islands.records.inspection.saturation import find_saturation
from support.known_records import lag, slow, steps, white

CLEAN = {
    "noise": lambda seed: white(3000, seed),
    "slow": lambda seed: slow(3000, seed),
    "sine": lambda seed: np.sin(2.0 * np.pi * (np.arange(3000) + seed) / 317.3),
    "response to steps": lambda seed: lag(steps(3000, seed), 5.0),
}


def find(values):
    channel = Channel("y_V", "V", values, is_output=True)
    return find_saturation(channel, find_quantisation(channel))


@pytest.mark.parametrize("name", CLEAN)
@pytest.mark.parametrize("digits", [2, 12])
def test_clean_signal_is_not_saturated(name, digits):
    for seed in range(5):
        assert find(np.round(CLEAN[name](seed), digits)).value == 0.0


@pytest.mark.parametrize("digits", [2, 12])
def test_share_of_clipped_samples_is_found(digits):
    for seed in range(5):
        y = slow(3000, seed)
        limit = np.quantile(y, 0.9)
        fact = find(np.round(np.minimum(y, limit), digits))
        assert fact.value == pytest.approx(0.1, abs=0.03)
        assert [title for title, _ in fact.details["places"]] == ["maximum"]


def test_steps_are_held_but_not_saturated():
    for seed in range(5):
        binary = np.sign(steps(3000, seed))
        assert find(binary).value is None
        assert find(steps(3000, seed)).value is None
