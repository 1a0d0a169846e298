"""Differential equations of a linear model: they have its simulation, and only stable processes have them."""

import numpy as np
import pytest

from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.linear import LinearSimulator
from islands.simulators.linear_states import LinearStates, approximate_cascade, list_states
from islands.simulators.ode.simulator import OdeSimulator

DT = 0.1

#: Coefficients of models with a direct term and with zeros.
MODELS = {
    "first-order": ([0.1, 0.05], [0.9]),
    "second-order": ([0.02, 0.06, 0.04], [1.5, -0.56]),
    "nearly equal poles": ([0.0, 0.01, 0.01], [1.81, -0.819]),
    "oscillator": ([0.02, 0.1, 0.1], [1.8, -0.9]),
    "oscillator with a negative gain": ([0.0, -0.1, -0.1], [1.8, -0.9]),
    "speed of an oscillator": ([0.0, 0.3, -0.29], [1.8, -0.9]),
    "fast oscillator": ([0.0, 0.3, 0.2], [1.2, -0.9]),
}


def make_linear(numerator: list[float], denominator: list[float], delay: int = 0) -> LinearSimulator:
    return LinearSimulator(np.array(numerator), np.array(denominator), 0.7, 0.3, delay, "V")


def get_values(linear: LinearSimulator) -> Signal:
    """Return the parameters of a model that does not begin at rest."""
    values = np.array([each.nominal for each in linear.parameters])
    values[-1] = 0.2
    return values


def simulate_equations(states: LinearStates, u: Signal, y: Signal) -> Signal:
    system = states.make_system("linear", "V", "V", float(np.max(np.abs(y))))
    initial = states.find_states(u, y)
    sizes = dict.fromkeys((*initial, *(f"d{name}/dt" for name in initial)), 1.0)
    simulator = ResampledSimulator(OdeSimulator(system, initial, sizes, {}), InterSample.ZOH, 32)
    context = make_context(Dataset(u, y, DT, ("u",)), simulator, u.size)
    simulation = ExtendedSimulator(simulator, (), context)
    return simulation.simulate(simulation.nominal)


@pytest.mark.ci
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("name", MODELS)
def test_equations_have_the_simulation_of_the_model(name: str, delay: int) -> None:
    linear = make_linear(*MODELS[name], delay)
    values, u = get_values(linear), np.random.default_rng(0).standard_normal(300)
    context = make_context(Dataset(u, u, DT, ("u",)), linear, u.size)
    y = ExtendedSimulator(linear, (), context).simulate(values)
    found = list_states(linear, values, DT)
    assert found
    for states in found:
        np.testing.assert_allclose(simulate_equations(states, u, y), y, atol=1e-6)


def test_processes_in_series_have_their_time_constants_and_one_gain() -> None:
    slow, fast = np.exp(-DT / np.array([1.5, 0.5]))
    # Zero-order hold of 2 / ((1.5 s + 1) (0.5 s + 1)), by partial fractions.
    parts = 2.0 * np.array([1.5, -0.5]) / (1.5 - 0.5) * (1.0 - np.array([slow, fast]))
    numerator = [0.0, parts.sum(), -(parts[0] * fast + parts[1] * slow)]
    linear = make_linear(numerator, [slow + fast, -slow * fast])
    for cascade in list_states(linear, get_values(linear), DT):
        assert sorted(cascade.times) == pytest.approx([0.5, 1.5])
        assert cascade.values["K1"] == pytest.approx(2.0)
        assert cascade.values["K2"] == pytest.approx(0.0, abs=1e-9)
        assert cascade.values["D"] == 0.0


@pytest.mark.parametrize(
    ("numerator", "denominator", "delay"),
    [
        pytest.param([0.3], [], 0, id="gain"),
        pytest.param([0.0, 0.1, 0.1], [1.8, -1.1], 0, id="unstable oscillator"),
        pytest.param([0.1, 0.05], [-0.5], 0, id="alternating"),
        pytest.param([0.0, 0.1], [1.0], 0, id="integrator"),
        pytest.param([0.0, 0.1, 0.0, 0.0], [0.9, 0.0, 0.0], 0, id="third order"),
    ],
)
def test_other_models_have_no_such_equations(
    numerator: list[float], denominator: list[float], delay: int
) -> None:
    linear = make_linear(numerator, denominator, delay)
    assert list_states(linear, get_values(linear), DT) == []


def test_a_model_with_zeros_is_approximated_by_two_processes_with_one_gain() -> None:
    single = make_linear([0.0, 0.1], [0.9], delay=2)
    for name, is_simple in (("nearly equal poles", True), ("oscillator", False)):
        linear = make_linear(*MODELS[name], 2)
        known = list_states(linear, get_values(linear), DT)
        found = approximate_cascade(linear, single, known, DT)
        assert (found is None) == is_simple
    assert found is not None
    assert found.values["K1"] == pytest.approx(1.0)
    assert (found.values["K2"], found.delay) == (0.0, 2)
    assert found.times.sum() == pytest.approx(-DT / np.log(0.9))


def test_equations_of_a_model_without_direct_term_have_none() -> None:
    linear = LinearSimulator(np.array([0.0, 0.1]), np.array([0.9]), 0.0, 0.0, 0, "V", has_direct_term=False)
    (cascade,) = list_states(linear, get_values(linear), DT)
    assert "D" not in cascade.values
    assert cascade.make_system("linear", "V", "V", 1.0).write_equations() == (
        "dx/dt = (K*u + level - x)/T; output = x"
    )
