"""Simulations in discrete time in C and MATLAB simulate like the package, with effects and terms."""

import json
from dataclasses import replace

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.errors import ModelError
from islands.export.extension import export_extended
from islands.export.fmu import find_compiler
from islands.persistence.models import model_json
from islands.records.input_lead import advance_all_inputs
from islands.simulation.predictors import free_run
from islands.simulators.extended import make_context
from islands.simulators.ode.system_document import make_output_system
from islands.simulators.output_equation import OutputEquation, add_output_equation
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import ColumnSpec, LinearSpec, ModelSpec
from support.equation_programs import OCTAVE, compare, extend, list_effects, run_c, run_matlab
from support.latent_systems import make_model
from support.simulated_records import MODEL_SPEC, recorded, wave

# Every program is compiled.
pytestmark = pytest.mark.ci

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")
needs_octave = pytest.mark.skipif(OCTAVE is None, reason="no octave-cli: install Octave to run the MATLAB")

SAMPLES = 150
U = wave(SAMPLES) + 3.0
RECORD = recorded(U, 2.0 + 0.3 * U, units=("V", "um"))
COLUMNS = {"other": 0.3 * U + 0.001 * U**2}


def specify(model):
    return ModelSpec(kind="model", model=json.loads(model_json(model)), name="m")


FILTER = {"kind": "linear", "numerator": (0.1, 0.02, -0.01), "denominator": (1.2, -0.5), "level": 1.5}
SIMULATIONS = {
    "linear": LinearSpec.model_validate({**FILTER, "order": 2, "delay": 3, "reference_input": 0.5}),
    "gain": LinearSpec(kind="linear", order=0, numerator=(0.3,), level=2.0, reference_input=1.0),
    "model": MODEL_SPEC,
    "functions": ModelSpec(
        kind="model",
        model={
            "schema": "islands.model/1",
            "inputs": ["u_V"],
            "output": "y_um",
            "terms": [
                {"regressor": "y(k-1)", "parameter": 0.8},
                {"regressor": "tanh(u(k-3))*abs(y(k-2))", "parameter": 0.05},
            ],
        },
        name="m",
    ),
    "state space": specify(make_model(units=("tanh",), output_name="y_um", dt=RECORD.dt)),
    "column": ColumnSpec(kind="column", column="other"),
}

#: Effects at all sites, with memory and with a dependence on the whole record.
EFFECTS = ("dead-zone", "delay", "backlash", "second-hysteresis", "coulomb-friction", "sensor-lag", "offset")


def make(name):
    return make_simulator(SIMULATIONS[name], RECORD, COLUMNS)


def list_own(simulator):
    names = [each.name for each in list_effects(simulator, RECORD)]
    return [CATALOGUE[each] for each in EFFECTS if each in names]


def add_term(simulator):
    """Return a simulation with terms as they are discovered."""
    context = make_context(RECORD, simulator, RECORD.samples)
    system = make_output_system(
        *(simulator.name, "y_sim + a1*rate(u)*u**2 + a2*tanh(y_sim*u/s1) + a3*t"),
        {"a1": {"value": 2e-5}, "a2": {"value": 0.3}, "s1": {"value": 4.0}, "a3": {"value": 0.1}},
    )
    return replace(add_output_equation(simulator, context), system=system)


def make_programs(names):
    """Return the documents and outputs: each simulation with effects, with terms, and with both."""
    specs, outputs = [], []
    for name in names:
        simulator = make(name)
        for each in (simulator, add_term(simulator)):
            for effects in ((), list_own(simulator)):
                if effects or isinstance(each, OutputEquation):
                    spec, expected = extend(each, RECORD, effects)
                    specs.append(spec)
                    outputs.append(expected)
    return specs, outputs


@needs_compiler
@pytest.mark.parametrize("name", SIMULATIONS)
def test_a_program_in_c_simulates_like_the_package(name, tmp_path):
    for spec, expected in zip(*make_programs([name]), strict=True):
        compare(run_c(spec, RECORD, tmp_path, COLUMNS), expected)


@needs_compiler
def test_a_state_space_whose_input_acts_at_once_reads_the_early_column(tmp_path):
    record = advance_all_inputs(RECORD)
    direct = {"a1_1": 0.9, "b1": 0.1, "c1": 0.5, "d": 0.2, "level": 1.0}
    model = make_model(direct, (), 1, input_names=("u_V+1",), output_name="y_um", dt=record.dt)
    spec, expected = extend(make_simulator(specify(model), record, {}), record)
    found = run_c(spec, record, tmp_path)
    compare(found, expected)
    # The effect of the initial states has decayed.
    np.testing.assert_allclose(found[100:], free_run(model, record).y[100:], atol=1e-3)


@needs_octave
def test_a_matlab_function_simulates_like_the_package(tmp_path):
    specs, outputs = make_programs(SIMULATIONS)
    programs = [(spec, RECORD) for spec in specs]
    for found, expected in zip(run_matlab(programs, tmp_path, COLUMNS), outputs, strict=True):
        compare(found, expected)


@needs_compiler
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("model", "column") else pytest.mark.nightly)
        for name in SIMULATIONS
    ],
)
def test_every_effect_has_a_program(name, tmp_path):
    simulator = make(name)
    for effect in list_effects(simulator, RECORD):
        if effect.name in CATALOGUE:
            spec, expected = extend(add_term(simulator), RECORD, [effect])
            compare(run_c(spec, RECORD, tmp_path, COLUMNS), expected)


def test_coefficients_that_a_record_determines_have_no_program():
    spec, _ = extend(add_term(make("linear")), RECORD)
    estimated = LinearSpec(kind="linear", order=2)
    with pytest.raises(ModelError, match="estimated from a record cannot be written in C or MATLAB"):
        export_extended(spec.model_copy(update={"core": estimated}), "c")
