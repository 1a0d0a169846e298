"""Latent models of several outputs: equations, files, the common free run and programs."""

import json
from dataclasses import replace

import numpy as np
import pytest

from islands.errors import ModelError
from islands.export import EXPORTS, export
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel
from islands.models.measured_signals import measured_block
from islands.persistence.models import model_json, read_coupled
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess
from islands.simulation.predictors import free_run
from support.coupled_systems import TWO_MASSES
from support.latent_systems import make_coupled_latent_model, smooth_input

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

BOTH = make_coupled_latent_model()


def make_record(samples=80, offset=0.0):
    rng = np.random.default_rng(0)
    return CoupledRecord(
        tuple(
            Dataset(
                smooth_input(samples, 3) + offset, rng.standard_normal(samples) + offset, 0.01, ("u_V",), name
            )
            for name in BOTH.output_names
        )
    )


def test_the_equations_number_outputs_states_and_units_one_after_the_other():
    written = BOTH.equation()
    assert written.plain.splitlines() == [
        "y1(k) = 1.2*x1(k) + 0.3",
        "x1(k) = 0.9*x1(k-1) + 0.3*x2(k-1) + 0.02*u(k-1)",
        "x2(k) = -0.3*x1(k-1) + 0.9*x2(k-1) + 0.15*u(k-1) - 0.05*h1(k-1)",
        "h1(k) = cube(1*x1(k))",
        "about rest at u = 0: resonance at 5.189 Hz with a damping ratio of 0.162",
        "y2(k) = 2*x3(k) - 1",
        "x3(k) = 0.8*x3(k-1) + 0.4*h2(k-1)",
        "h2(k) = min(max(1.5*u(k) + 0.1, -1), 1)",
        "about rest at u = 0: time constant 0.04481 s",
    ]
    assert "force(k) = 2*x3(k)" in written.named
    assert "y_{2,k}" in written.latex
    assert "<mn>3</mn>" in written.mathml
    assert BOTH.parameter_names[-1] == "y2: level"
    assert written.terms[0] == "y_mm: a1_1"


def test_the_common_free_run_is_that_of_every_model():
    record = make_record()
    common = free_run(BOTH, record, 25)
    for place, model in enumerate(BOTH.models):
        np.testing.assert_array_equal(common.y[:, place], free_run(model, record.records[place], 25).y)


def test_a_file_of_models_of_several_classes_is_refused():
    entries = [json.loads(model_json(each)) for each in (TWO_MASSES.models[0], BOTH.models[1])]
    with pytest.raises(ModelError, match="a NARX model is needed, this one is of the class latent"):
        read_coupled({"models": entries}, "mixed")
    for kind, model in ((CoupledModel, BOTH.models[0]), (CoupledLatentModel, TWO_MASSES.models[0])):
        with pytest.raises(ModelError, match=r"NARX model is needed|is no latent model"):
            kind((model, BOTH.models[1]))


def test_offsets_are_subtracted_from_inputs_and_added_to_outputs():
    record = make_record(offset=5.0).map(lambda each: preprocess(each, detrend="constant"))
    done = [each.preprocessing for each in record.records]
    pairs = zip(BOTH.models, done, strict=True)
    model = CoupledLatentModel(tuple(replace(each, preprocessing=steps) for each, steps in pairs))
    measured = make_record(offset=5.0)
    deviations = free_run(model, record, 25).y
    offsets = [each.output_offset for each in done]
    np.testing.assert_allclose(free_run(model, measured, 25).y, deviations + offsets, rtol=1e-12)
    assert "y1 is the deviation from" in model.equation().plain
    assert "where y1 is the deviation from" in measured_block(model).texts[-1]


@pytest.mark.parametrize("kind", EXPORTS)
def test_every_text_format_has_both_outputs(kind):
    second = {"latex": "y_{2,k}", "mathml": "<mi>y</mi><mrow><mn>2</mn>", "json": "force (N)"}
    assert second.get(kind, "y2") in export(BOTH, kind)
