"""Play of a sensor, and of the drive."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import islands
from islands.kernels.memory_operators import play_from

DT, SAMPLES = 0.005, 2000


def draw_force(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    return np.asarray(lfilter([0.2], [1.0, -0.8], noise))


def move(force: np.ndarray) -> np.ndarray:
    """Return the response of a mass of 8 Hz with a damping ratio of 0.1 to a force."""
    w = 2 * np.pi * 8.0
    b, a, _ = cont2discrete(([w * w], [1.0, 0.2 * w, w * w]), DT, method="foh")
    return np.asarray(lfilter(np.ravel(b), a, force))


def make_record(seed: int, sensor: float, drive: float, noise: float = 0.01) -> islands.Dataset:
    """Return a record with plays of the sensor and of the drive, relative to the peaks."""
    u = draw_force(seed)
    y = move(play_from(u, drive * np.abs(u).max()))
    y = play_from(y, sensor * np.abs(y).max())
    y = y + noise * y.std() * np.random.default_rng(seed + 1).standard_normal(SAMPLES)
    return islands.Dataset(u[:, None], y, DT, ("F_N",), "x_mm", ("N",), "mm")


@pytest.mark.nightly
def test_play_of_the_sensor_is_named_and_holds_on_another_record() -> None:
    found = islands.diagnose(make_record(1, 0.06, 0.0), "second-order")
    assert (str(found.verdict), found.claimed_names) == ("named", ("sensor-hysteresis",))
    other = make_record(2, 0.06, 0.0, 0.0)
    assert np.std(found.simulate(other).y - other.y) < 0.02 * other.y.std()
