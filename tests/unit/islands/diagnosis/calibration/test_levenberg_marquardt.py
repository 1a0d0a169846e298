"""Covariance of calibrated values: intervals do not depend on values that others make up for."""

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate, estimate_deviations
from islands.diagnosis.calibration.preparation import make_target
from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, Site
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator

NOISE = 0.05


def estimate(effects: tuple[Effect, ...], leak: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the input, and the deviations of a gain ``k`` and of the values of effects."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    record = Dataset(u, 2.0 * u + NOISE * rng.standard_normal(u.size), 0.1)
    simulator = PythonFunctionSimulator(lambda u, dt, k=2.0: k * u + leak * k**2 * u**3 + 0.0 * dt, "gain")
    target = make_target(record, 400, {})
    simulation = ExtendedSimulator(simulator, effects, make_context(record, simulator, 400))
    fit = calibrate(simulation, target, simulation.nominal)
    return u, estimate_deviations(fit, target)


def make_gain() -> Effect:
    return Effect(
        name="theirs",
        summary="a gain of the output",
        family="scale",
        site=Site.OUTPUT,
        parameters=lambda _: (Parameter("c", "", 0.0, 0.01),),
        starting_points=lambda _context, _residual: ((0.1,),),
        form=lambda y, values, _: y * (1.0 + values[0]),
        source="none",
    )


def test_gain_that_another_one_makes_up_for_is_held() -> None:
    u, (of_simulation, of_effect) = estimate((make_gain(),))
    assert of_simulation == 0.0
    assert of_effect == pytest.approx(NOISE / np.linalg.norm(2.0 * u), rel=0.2)


@pytest.mark.parametrize("leak", [1e-12, 1e-6])
def test_interval_of_a_value_that_is_almost_undetermined_is_as_narrow(leak: float) -> None:
    u, (_, of_effect) = estimate((make_gain(),), leak)
    assert of_effect == pytest.approx(NOISE / np.linalg.norm(2.0 * u), rel=0.2)
