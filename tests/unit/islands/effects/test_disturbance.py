"""Periodic disturbance: a line of the residual that the input cannot have caused."""

import numpy as np
import pytest

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


@pytest.mark.parametrize("frequency", [1.5 * INPUT, 2.5 * INPUT, 7.3])
def test_line_between_the_harmonics_of_the_input_is_a_disturbance(frequency: float) -> None:
    assert find_frequencies(U, frequency) == pytest.approx([frequency], abs=0.02)


def test_input_without_a_single_line_has_no_harmonics() -> None:
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    assert find_frequencies(noise, 2.0) == pytest.approx([2.0], abs=0.02)
    assert find_frequencies(np.zeros(TIME.size), 2.0) == pytest.approx([2.0], abs=0.02)


def test_short_record_of_a_few_periods_has_no_harmonics() -> None:
    assert find_frequencies(np.sin(2 * np.pi * 0.3 * TIME), 0.9) == pytest.approx([0.9], abs=0.02)
