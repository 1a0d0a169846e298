"""Simulation of a specification on a record."""

import json
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.errors import RecordError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.persistence.models import model_json
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess
from islands.simulation.predictors import free_run
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import ModelSpec

DT = 0.01


def test_initial_states_are_found_with_friction_from_those_of_another_record() -> None:
    rng = np.random.default_rng(3)
    time = DT * np.arange(600)
    u = 6.0 * np.sin(2 * np.pi * np.outer(time, rng.uniform(0.2, 3.0, 8)) + rng.uniform(0, 6.3, 8)).sum(
        axis=1
    )
    u *= np.minimum(1.0, time)
    document = {
        "kind": "ode",
        "name": "oscillator",
        "input": "u",
        "output": "x",
        "equations": "dx/dt = v\ndv/dt = u - 2*v - 100*x - 6*sign(v)*exp(-(v/0.5)**2)\n",
        "states": {"x": {"unit": "m"}, "v": {"unit": "m/s"}},
    }
    silent = Dataset(u, np.zeros(600), DT, ("u",), output_name="y")
    at_rest = {**document, "states": {name: {"initial": 0.0, "fixed": True} for name in ("x", "v")}}
    y = simulate_spec(OdeSpec.model_validate(at_rest), silent)
    record = Dataset(u, y + 0.002 * rng.standard_normal(600), DT, ("u",), output_name="y")
    moving = {**document, "states": {"x": {"unit": "m"}, "v": {"unit": "m/s", "initial": -2.0}}}
    assert np.max(np.abs(simulate_spec(OdeSpec.model_validate(moving), record) - y)) < 0.002


# An identified model as the simulation of a diagnosis.


def measured_record():
    rng = np.random.default_rng(3)
    u = 4.0 + np.repeat(rng.uniform(-1.0, 1.0, 40), 10)
    return Dataset(u, 7.0 + 0.1 * np.cumsum(u - 4.0), DT, ("u_V",), "y_um")


def model_of(prepared, average=1):
    """Return a model of a preprocessed record."""
    terms = [(parse("y(k-1)"), 0.8), (parse("u(k-1)"), 0.2), (parse("y(k-2)*u(k-1)"), 0.01)]
    model = make_model(terms, ("u_V",), "y_um", prepared.dt * average)
    return replace(model, average=average, preprocessing=prepared.preprocessing)


def as_spec(model):
    return ModelSpec(kind="model", name="m", model=json.loads(model_json(model)))


@pytest.mark.parametrize(
    "steps",
    [{"detrend": "constant"}, {"decimate": 2}, {"lowpass": 5.0, "decimate": 2, "detrend": "constant"}],
    ids=str,
)
def test_a_diagnosis_reads_the_signals_of_its_model(steps) -> None:
    """At the rate of the model, measured or as deviations, the simulation of a diagnosis is the free run."""
    measured = measured_record()
    model = model_of(preprocess(measured, **steps))
    rate = {name: value for name, value in steps.items() if name != "detrend"}
    for record in (preprocess(measured, **rate), preprocess(measured, **steps)):
        simulator = make_simulator(as_spec(model), record)
        context = make_context(record, simulator, record.samples)
        nominal = ExtendedSimulator(simulator, (), context)
        found = nominal.simulate(nominal.nominal)
        np.testing.assert_allclose(found[2:], free_run(model, record).y[2:], rtol=1e-9)


def test_a_diagnosis_of_samples_that_a_model_does_not_read_says_what_to_do() -> None:
    measured = measured_record()
    filtered = model_of(preprocess(measured, decimate=2))
    with pytest.raises(RecordError) as caught:
        islands.diagnose(measured, filtered)
    assert str(caught.value) == (
        "of the model, each value is one of 2 samples of 0.01 s behind a zero-phase low-pass filter of "
        "20 Hz, and a diagnosis reads the record as it is: identify the model without lowpass and "
        "decimate, or give islands.diagnose the record of islands.preprocess(record, decimate=2)"
    )
    make_simulator(as_spec(filtered), preprocess(measured, decimate=2))
    with pytest.raises(RecordError, match=r"the mean of 4 samples of the record, .* identify the model with"):
        islands.diagnose(measured, model_of(measured, average=4))
