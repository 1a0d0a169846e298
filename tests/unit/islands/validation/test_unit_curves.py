"""Curves of units: they are the static laws of the systems, in any coordinates of the states."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.validation.ensemble import Ensemble, EnsembleStructure
from islands.validation.unit_curves import Abscissa, trace_unit_curves
from support.latent_systems import SPRING, make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

HAMMERSTEIN = {"a1_1": 0.8, "b1": 0.1, "c1": 2.0, "e1_1": 0.3, "v1": 1.5, "s1": 0.2, "level": 0.4}
WIENER = {"a1_1": 0.8, "b1": 0.1, "c1": 2.0, "f1": 0.7, "w1_1": 3.0, "s1": -0.2, "o1": 0.05}


def trace(model, **changes):
    (curve,) = trace_unit_curves(model, spring_record(600), 20, **changes)
    return curve


def hold(model, level: float) -> float:
    """Return the output after a long hold of the input."""
    record = Dataset(np.full(1500, level), np.zeros(1500), 0.01, ("u_V",), "y_mm")
    return float(free_run(model, record).y[-1])


@pytest.mark.parametrize("level", [-1.0, 0.4, 1.2])
def test_the_curve_of_a_spring_is_its_effect_on_the_output_at_rest(level):
    spring, curve = make_model(), trace(make_model())
    linear = make_model({name: value for name, value in SPRING.items() if name[0] not in "ew"}, ())
    found = np.interp(hold(spring, level), curve.x, curve.y)
    assert curve.abscissa is Abscissa.OUTPUT
    assert found == pytest.approx(hold(spring, level) - hold(linear, level), abs=1e-4)


@pytest.mark.parametrize(("parameters", "unit"), [(HAMMERSTEIN, "tanh"), (WIENER, "square")])
def test_a_curve_over_the_input_is_the_effect_of_the_unit_at_rest(parameters, unit):
    model = make_model(parameters, (unit,), 1)
    linear = make_model({name: value for name, value in parameters.items() if name[0] not in "efwvs"}, (), 1)
    record = spring_record(600)
    # A run that leaves the range of the output by more than the range ends.
    loud = Dataset(record.u, 10.0 * record.y, 0.01, ("u_V",), "y_mm")
    (curve,) = trace_unit_curves(model, loud, 20)
    for level in (-1.0, 0.0, 0.7):
        found = np.interp(level, curve.x, curve.y)
        assert found == pytest.approx(hold(model, level) - hold(linear, level), abs=1e-4)
    assert curve.abscissa is (Abscissa.INPUT if "v1" in parameters else Abscissa.CONSTANT_INPUT)


def test_without_a_static_gain_a_curve_is_the_effect_on_a_state():
    integrator = make_model({**SPRING, "a1_1": 1.0, "a1_2": 0.0, "a2_1": 0.0}, order=2)
    curve = trace(integrator)
    assert curve.state == 1
    assert np.abs(curve.y).max() > 0.0


def test_the_range_is_that_of_the_free_run_and_goes_on_over_further_data():
    model = make_model(HAMMERSTEIN, ("tanh",), 1)
    record = spring_record(600)
    louder = Dataset(1.5 * record.u, record.y, 0.01, ("u_V",), "y_mm")
    curve = trace(model, further=louder)
    used = record.u[20:]
    assert curve.reached == pytest.approx((used.min(), used.max()))
    assert (curve.x[0], curve.x[-1]) == pytest.approx((1.5 * used.min(), 1.5 * used.max()))


def make_ensemble(model, members) -> Ensemble:
    return Ensemble((EnsembleStructure(model, 1.0, np.array(members)),))


def test_the_band_has_the_spread_of_the_members_with_the_structure():
    model = make_model(HAMMERSTEIN, ("tanh",), 1)
    draws = np.tile(model.parameters, (60, 1))
    gains = 1.0 + 0.1 * np.random.default_rng(0).standard_normal(60)
    draws[:, model.names.index("e1_1")] *= gains
    curve = trace(model, ensemble=make_ensemble(model, draws))
    spread = np.sqrt(np.mean((gains - 1.0) ** 2))
    assert curve.half_width == pytest.approx(1.96 * spread * np.abs(curve.y))
