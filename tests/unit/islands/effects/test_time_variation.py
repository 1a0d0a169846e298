"""Changes of the gain: a temperature is named, with its coefficient, and is no drift of the zero."""

import numpy as np
import pytest
from scipy.signal import lfilter

import islands


def make_warm_record(seed: int, gain: float, drift: float = 0.0) -> islands.Dataset:
    """Return a record of a linear system whose gain, or zero, depends on a temperature."""
    rng = np.random.default_rng(seed)
    u = np.asarray(lfilter([0.2], [1.0, -0.9], rng.standard_normal(1500))) + 0.3
    heat = np.asarray(lfilter([0.01], [1.0, -0.99], rng.standard_normal(1500).cumsum()))
    heat = 10.0 * (heat - heat[0]) / np.ptp(heat)
    y = lfilter([0.0, 0.05, 0.05], [1.0, -1.6, 0.7], u * (1.0 + gain * heat))
    y += drift * y.std() * heat + 0.02 * y.std() * rng.standard_normal(u.size)
    inputs = np.column_stack([u, 293.0 + heat])
    return islands.Dataset(inputs, y, 0.01, ("F_N", "T_K"), "x_m", ("N", "K"), "m")


@pytest.mark.nightly
@pytest.mark.parametrize(("seed", "gain"), [(0, 0.03), (1, -0.02), (2, 0.05)])
def test_gain_that_depends_on_a_temperature_is_named_with_its_coefficient(seed: int, gain: float) -> None:
    found = islands.diagnose(make_warm_record(seed, gain), "linear:2")
    assert (str(found.verdict), found.claimed_names) == ("named", ("temperature-gain",))
    value = found.effects[0].parameters["k"]
    assert (value.value, value.unit) == (pytest.approx(gain, rel=0.05), "1/K")
    other = make_warm_record(seed + 100, gain)
    error = found.simulate(other).y - other.y
    assert error.std() < 0.03 * other.y.std()


@pytest.mark.nightly
@pytest.mark.parametrize(("drift", "names"), [(0.05, ("thermal-drift",)), (0.0, ())])
def test_zero_that_depends_on_a_temperature_is_no_change_of_the_gain(
    drift: float, names: tuple[str, ...]
) -> None:
    assert islands.diagnose(make_warm_record(3, 0.0, drift), "linear:2").claimed_names == names
