"""Disturbances: a line of the residual that the input cannot have caused, and a second input."""

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.effects.disturbance import PERIODIC_DISTURBANCE
from islands.effects.interface.context import SimulationContext

TIME = 0.01 * np.arange(2000)

#: Frequency of the input in hertz.
INPUT = 0.87

U = np.sin(2 * np.pi * INPUT * TIME)


def find_frequencies(u: np.ndarray, frequency: float) -> list[float]:
    context = SimulationContext(u, 0.01, {}, {}, 1.0, 1.0, "V", "V", 15.0)
    residual = 0.1 * np.sin(2 * np.pi * frequency * TIME + 1.0)
    return [point[2] for point in PERIODIC_DISTURBANCE.starting_points(context, residual)]


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_harmonic_of_the_input_is_no_disturbance(order: int) -> None:
    assert all(abs(each - order * INPUT) > 1.0 / 15.0 for each in find_frequencies(U, order * INPUT))


def make_two_inputs(seed: int, gain: float, coupled: float = 0.0) -> islands.Dataset:
    """Return a record of a linear system with two forces; the second one may couple into the output."""
    rng = np.random.default_rng(seed)
    u, w = (np.asarray(lfilter([0.2], [1.0, -0.9], rng.standard_normal(1500))) for _ in range(2))
    y = lfilter([0.0, 0.05, 0.05], [1.0, -1.6, 0.7], u + gain * w)
    y += coupled * y.std() * w + 0.02 * y.std() * rng.standard_normal(u.size)
    return islands.Dataset(np.column_stack([u, w]), y, 0.01, ("F1_N", "F2_N"), "x_m", ("N", "N"), "m")


@pytest.mark.nightly
@pytest.mark.parametrize(("seed", "gain"), [(0, 0.8), (1, 0.1), (2, -1.5), (3, 0.3), (4, 2.0)])
def test_second_input_that_the_simulation_ignores_is_named_with_its_gain(seed: int, gain: float) -> None:
    found = islands.diagnose(make_two_inputs(seed, gain), "linear:2")
    assert (str(found.verdict), found.claimed_names) == ("named", ("second-input",))
    value = found.effects[0].parameters["k"]
    assert (value.value, value.unit) == (pytest.approx(gain, rel=0.05), "N/N")
    sentence = "The input F2_N acts on the system where F1_N does, and the simulation does not read it."
    assert sentence in found.summary
    other = make_two_inputs(seed + 100, gain)
    error = found.simulate(other).y - other.y
    assert error.std() < 0.03 * other.y.std()
    program = found.export("c")
    assert program is not None
    assert "F2_N" in program


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_channel_that_couples_into_the_output_is_no_second_input(seed: int) -> None:
    found = islands.diagnose(make_two_inputs(seed, 0.0, 0.3), "linear:2")
    assert found.claimed_names == ("cross-coupling",)
    assert "acts on the system" not in found.summary
