"""Latent models: equations, structure, documents, rest and modes."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import ModelError
from islands.export import export
from islands.models.latent import LatentModel
from islands.models.unit_functions import FUNCTIONS
from islands.records.dataset import Dataset
from islands.records.flat_extremes import SensorLimits
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci


def test_equations_have_the_units_as_signals():
    assert make_model().equation().plain.splitlines() == [
        "y(k) = 1.2*x1(k) + 0.3",
        "x1(k) = 0.9*x1(k-1) + 0.3*x2(k-1) + 0.02*u(k-1)",
        "x2(k) = -0.3*x1(k-1) + 0.9*x2(k-1) + 0.15*u(k-1) - 0.05*h1(k-1)",
        "h1(k) = cube(1*x1(k))",
        "about rest at u = 0: resonance at 5.189 Hz with a damping ratio of 0.162",
    ]
    assert make_model().equation().named.startswith("y_mm(k) = 1.2*x1(k)")


def test_the_size_of_a_linear_model_does_not_count_coordinates_of_its_states():
    lag = {"a1_1": 0.9, "b1": 0.1, "c1": 3.0, "level": 0.2}
    single = make_model(lag, (), 1, delays=(5,))
    assert (single.size, single.free_size, single.structure) == (4, 4, "order 1, dead time of u_V 0.05 s")
    pair = {"a1_1": 0.9, "a1_2": 0.3, "a2_1": -0.3, "a2_2": 0.9, "b1": 0.1, "b2": 0.2, "c1": 1.0}
    assert (make_model(pair, (), 2).free_size, make_model(pair, (), 2).structure) == (4, "order 2")
    assert make_model().free_size == make_model().size - 2  # the scales of two states


def test_inputs_that_are_read_early_are_read_at_sample_k():
    model = make_model(SPRING | {"level": 0.3}, input_names=("u_V+1",))
    direct = make_model(
        {**dict(list(SPRING.items())[:7]), "d": 0.7, **dict(list(SPRING.items())[7:])}, input_names=("u_V+1",)
    )
    assert "0.02*u_V(k-1)" in model.equation().named
    assert "0.7*u_V(k)" in direct.equation().named
    assert direct.reads_at_once
    assert not replace(direct, input_names=("u_V",), delays=(1,)).reads_at_once
    with pytest.raises(ModelError, match="one sample early"):
        replace(direct, input_names=("u_V",))


def test_the_free_run_continues_from_the_states_of_the_warm_up():
    record = spring_record()
    run = free_run(make_model(), record)
    assert np.isnan(run.y[:20]).all()
    assert run.y[20:] == pytest.approx(record.y[20:], abs=1e-3)
    longer = free_run(make_model(), record, 200)
    assert longer.y[200:] == pytest.approx(record.y[200:], abs=1e-4)


@pytest.mark.parametrize("unit", [*FUNCTIONS, "tanh(square)", "s*abs", "bell*(s*root)"])
def test_a_program_is_the_simulation_from_the_same_states(unit):
    """The record rests in the warm-up, so that the estimated states are those of the program."""
    model, module = make_model(units=(unit,)), {}
    exec(export(model, "python"), module)
    rest = 1.2 * model.rest[0] + 0.3
    record = spring_record(300)
    u = np.concatenate([np.zeros(20), record.u[:, 0]])
    y = np.concatenate([np.full(20, rest), record.y])
    found = module["simulate"](u.tolist())
    data = Dataset(u, y, record.dt, record.input_names, record.output_name)
    assert found[20:] == pytest.approx(free_run(model, data).y[20:].tolist(), abs=1e-9)


def test_the_output_is_limited_as_that_of_the_sensor():
    model, module = make_model(limits=SensorLimits(-0.5, 0.9)), {}
    assert model.equation().line.startswith("y(k) = min(max(1.2*x1(k) + 0.3, -0.5), 0.9)")
    third = make_model(limits=SensorLimits(None, 1.0 / 3.0))
    assert third.equation().line.startswith("y(k) = min(1.2*x1(k) + 0.3, 0.333333)")
    assert str(1.0 / 3.0) in export(third, "python")
    exec(export(model, "python"), module)
    record = spring_record(300)
    run, unlimited = (free_run(each, record).y[20:] for each in (model, make_model()))
    assert run.min() == -0.5
    assert run.max() == 0.9
    # The states are those of the sensor without limits, except for their estimate from the warm-up.
    assert run[60:] == pytest.approx(np.clip(unlimited, -0.5, 0.9)[60:], abs=1e-3)
    found = module["simulate"](record.u[:, 0].tolist())
    assert (min(found), max(found)) == (-0.5, 0.9)


def test_a_document_has_the_whole_model():
    model = make_model(standard_errors=(0.1,) * 10, operating_inputs=(0.2,), limits=SensorLimits(None, 2.0))
    assert LatentModel.read(model.document(), "model.json") == model


def test_standard_errors_follow_the_quantities():
    model = make_model(quantity_errors=(0.0123, 0.0045, 0.067))
    assert [(each.name, each.unit, each.input) for each in model.quantities] == [
        ("frequency", "Hz", None),
        ("damping ratio", "", None),
        ("static gain", "", 1),
    ]
    assert model.equation().plain.splitlines()[-1] == (
        "about rest at u = 0 (+- standard errors): resonance at 5.189 +- 0.012 Hz with a damping ratio of "
        "0.162 +- 0.0045; static gain of u 0.564 +- 0.067"
    )
    assert model.equation().named.endswith("static gain of u_V 0.564 +- 0.067")
