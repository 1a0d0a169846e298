"""Functions that are sequences of instructions, computed by the kernel."""

import math

import numpy as np
import pytest

from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.sampled_signal import interpolate_linearly
from islands.simulators.ode.system_document import make_system

pytestmark = pytest.mark.ci


def evaluate(function: str, argument: np.ndarray) -> np.ndarray:
    """Return a function of the input of a system whose state is constant."""
    system = make_system(
        {
            "name": "s",
            "input": "F",
            "equations": "dx/dt = 0",
            "output": f"{function} + 0*x",
            "states": {"x": {}},
        }
    )
    lane = LaneInput({}, {"x": 0.0}, {"F": interpolate_linearly(argument)})
    return simulate_lanes(generate_program(system), 1.0, [lane])[0, 0]


ARGUMENTS = np.concatenate([np.geomspace(1e-300, 30.0, 20_000), np.linspace(0.0, 25.0, 20_000)])


def test_tanh_agrees_with_the_library() -> None:
    expected = np.array([math.tanh(x) for x in ARGUMENTS])
    assert evaluate("tanh(F)", ARGUMENTS) == pytest.approx(expected, rel=1.2e-15, abs=0.0)


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_agree_with_the_library(name: str) -> None:
    multiples = 0.5 * np.pi * np.arange(-2000, 2001)
    arguments = np.concatenate([ARGUMENTS, -ARGUMENTS, np.linspace(-1e6, 1e6, 40_000), multiples])
    expected = np.array([getattr(math, name)(x) for x in arguments])
    assert evaluate(f"{name}(F)", arguments) == pytest.approx(expected, rel=0.0, abs=5e-16)


@pytest.mark.parametrize("power", range(1, 9))
def test_powers_are_products(power: int) -> None:
    argument = np.linspace(-3.0, 3.0, 601)
    assert evaluate(f"F**{power}", argument) == pytest.approx(argument**power, rel=1e-14)
