"""`CalibrationProblem`: derivatives in the call of a point or after it, and damped steps."""

import numpy as np
import pytest

from islands.diagnosis.calibration import levenberg_marquardt
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.problem import CalibrationProblem, simulate_together
from islands.diagnosis.calibration.target import Target
from islands.effects.catalogue import CATALOGUE
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import recorded, wave

pytestmark = pytest.mark.ci

SPRING = PhysicalSpec(kind="second-order", parameters={"m": 0.5, "c": 4.0, "k": 200.0})


@pytest.fixture(scope="module")
def oscillator() -> tuple[ExtendedSimulator, Target]:
    """A linear oscillator with a cubic spring to be found, and a record with noise."""
    u = wave(240)
    record = recorded(u, u / 200.0)
    core = make_simulator(SPRING, record)
    simulation = ExtendedSimulator(core, (CATALOGUE["cubic-stiffness"],), make_context(record, core, 180))
    y = simulation.simulate(1.03 * simulation.nominal) + 1e-2 * np.random.default_rng(4).standard_normal(240)
    return simulation, Target(y, np.arange(240) < 180, None, {}, fitted=180)


def test_derivatives_of_the_same_call_have_the_same_bits(
    oscillator: tuple[ExtendedSimulator, Target],
) -> None:
    simulation, target = oscillator
    free = np.zeros(simulation.nominal.size)
    problem = CalibrationProblem(simulation, target, free, simulation.nominal)
    (at_once,) = simulate_together(simulation, [problem.evaluate(simulation.nominal, with_jacobian=True)])
    (point,) = simulate_together(simulation, [problem.evaluate(simulation.nominal)])
    (later,) = simulate_together(simulation, [problem.linearise(point)])
    assert at_once.jacobian is not None
    assert later.jacobian is not None
    assert at_once.jacobian.tobytes() == later.jacobian.tobytes()
    assert (at_once.cost, at_once.output.tobytes()) == (later.cost, later.output.tobytes())


def test_step_without_damping_solves_the_linearised_problem(
    oscillator: tuple[ExtendedSimulator, Target],
) -> None:
    simulation, target = oscillator
    free = np.zeros(simulation.nominal.size)
    problem = CalibrationProblem(simulation, target, free, simulation.nominal)
    values = 1.001 * simulation.nominal
    (point,) = simulate_together(simulation, [problem.evaluate(values, with_jacobian=True)])
    assert point.jacobian is not None
    steps, predicted = problem.find_steps(point, np.array([1e-12, 1e3]))
    expected = np.linalg.lstsq(point.jacobian, point.residual, rcond=None)[0] * simulation.scales
    np.testing.assert_allclose(steps[0] - point.values, expected, rtol=1e-4)
    assert predicted[0] > predicted[1] > 0.0


def test_simulations_in_groups_give_the_same_fit(
    oscillator: tuple[ExtendedSimulator, Target], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation, target = oscillator
    one_by_one = calibrate(simulation, target, simulation.nominal)
    monkeypatch.setattr(levenberg_marquardt, "MIN_BATCHED_SAMPLES", 1)
    grouped = calibrate(simulation, target, simulation.nominal)
    assert grouped.values.tobytes() == one_by_one.values.tobytes()


@pytest.mark.parametrize(("chi", "g"), [(8.0, 0.0), (1.0, 0.8)])
def test_calibration_reaches_values_next_to_the_limit_of_an_effect(chi: float, g: float) -> None:
    """The first steps lead beyond |g| = 1.5 chi, where the response does not depend on g."""
    u = wave(600)
    record = recorded(u, u / 200.0)
    core, effect = make_simulator(SPRING, record), CATALOGUE["second-hysteresis"]
    context = make_context(record, core, 450)
    simulation, peak = ExtendedSimulator(core, (effect,), context), context.force_coordinate.peak
    true, start = simulation.nominal, simulation.nominal
    part = simulation.get_slice(effect)
    true[part] = [60.0, 4.0 / peak, -1.4 * 4.0 / peak, 0.0]
    start[part] = [30.0, chi / peak, g * chi / peak, 0.0]
    target = Target(simulation.simulate(true), np.arange(600) < 450, None, {}, fitted=450)
    fit = calibrate(simulation, target, start)
    np.testing.assert_allclose(fit.values[part][:3], true[part][:3], rtol=1e-3)
