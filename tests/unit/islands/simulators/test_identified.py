"""Identified models in free run, and the missing terms of one: names, response, and the model with them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate, evaluate_fit
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.calibration.target import Target
from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model
from islands.persistence.models import model_from_json
from islands.records.dataset import join
from islands.records.input_lead import advance_all_inputs
from islands.records.preprocessing_steps import Preprocessing, PreprocessingSteps
from islands.report.documents.extension import extended_document
from islands.simulation.predictors import free_run
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.identified import NarxSimulator
from islands.simulators.specification.factory import make_model_simulator
from lab.diagnosis.cases import CASES
from lab.diagnosis.injection.measurement import FaultyRecord, inject
from support import latent_systems


@pytest.fixture(scope="module")
def faulty() -> FaultyRecord:
    return inject([], np.random.default_rng(804), 20.0)


@pytest.fixture(scope="module")
def extended(faulty: FaultyRecord) -> ExtendedSimulator:
    """Return an identified model with its missing terms as an effect."""
    simulator = CASES["narx"].make(faulty)
    context = make_context(faulty.record, simulator, 1500)
    return ExtendedSimulator(simulator, simulator.state_effects, context)


def get_starting_values(extended: ExtendedSimulator, faulty: FaultyRecord) -> np.ndarray:
    """Return the first starting point of the calibration of the terms."""
    (effect,) = extended.effects
    values = extended.nominal
    at_rest = extended.with_effects(()).simulate(values[: extended.get_slice(effect).start])
    values[extended.get_slice(effect)] = effect.starting_points(extended.context, faulty.record.y - at_rest)[
        0
    ]
    return values


def model(**terms: str) -> Model:
    split = (term.split(" * ", 1) for term in terms.values())
    return make_model([(parse(text), float(parameter)) for parameter, text in split])


def test_calibrated_missing_terms_reduce_the_error_to_the_noise(
    extended: ExtendedSimulator, faulty: FaultyRecord
) -> None:
    alone = extended.with_effects(())
    target = Target(faulty.record.y, np.arange(2000) < 1500, None, {}, fitted=1500)
    before = calibrate(alone, target, alone.nominal)
    after = calibrate(extended, target, get_starting_values(extended, faulty))
    assert before.mean_square > 1.2 * faulty.sigma**2
    assert after.mean_square < 1.05 * faulty.sigma**2


def test_starting_points_do_not_depend_on_hold_out_samples(extended: ExtendedSimulator) -> None:
    (effect,) = extended.effects
    residual = np.random.default_rng(1).standard_normal(2000)
    changed = np.where(np.arange(2000) < 1500, residual, 9.0)
    assert effect.starting_points(extended.context, residual) == effect.starting_points(
        extended.context, changed
    )


def test_an_extended_model_contains_the_missing_terms(
    extended: ExtendedSimulator, faulty: FaultyRecord
) -> None:
    record, values = faulty.record, get_starting_values(extended, faulty)
    target = Target(record.y, np.arange(record.samples) < 1500, None, {}, fitted=1500)
    fit = evaluate_fit(extended, target, values)
    document = extended_document(fit, record)
    assert document["effects"] == []
    written = model_from_json(json.dumps(document["core"]["model"]), "extended")
    assert isinstance(extended.simulator, NarxSimulator)
    assert written.size == extended.simulator.model.size + len(extended.parameters) - 8 - 1
    # The maximum lag is one larger: the free run starts one sample later, from the measured output.
    again = simulate_spec(document, record)
    assert np.std((again - fit.output)[200:]) < 0.3 * faulty.sigma


def test_small_models_have_missing_terms_only_if_they_read_the_input() -> None:
    start = np.zeros(3)
    of_levels = NarxSimulator(model(a="0.5 * y(k-1)", b="0.4 * u(k-1)"), "levels", start)
    (effect,) = of_levels.state_effects
    assert effect.family == "shape"
    output_alone = NarxSimulator(model(a="0.5 * y(k-1)", b="0.1 * y(k-2)"), "output alone", start)
    assert output_alone.state_effects == ()


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.5, -0.4)])
@pytest.mark.parametrize("is_early", [False, True])
@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_a_diagnosis_simulates_a_state_space_as_simulate_does(
    start: tuple[float, float], is_early: bool, offset: float
) -> None:
    """The states are estimated from the first samples, which rest in some records only."""
    record, spring = latent_systems.spring_record(300, start=start), latent_systems.make_model(memory=45)
    if is_early:
        record, spring = advance_all_inputs(record), replace(spring, input_names=("u_V+1",))
    done = Preprocessing(PreprocessingSteps(detrend="constant"), record.dt, (offset,), -offset, 0.0)
    record = replace(record, u=record.u + offset, y=record.y - offset)
    simulator = make_model_simulator(replace(spring, preprocessing=done), "spring", record)
    alone = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    simulated = alone.simulate(alone.nominal)
    np.testing.assert_allclose(simulated, record.y, atol=1e-3)
    expected = free_run(replace(spring, preprocessing=done), record).y
    np.testing.assert_allclose(simulated[45:], expected[45:], rtol=1e-9)


def test_the_states_of_every_recording_are_its_own() -> None:
    record = join(tuple(latent_systems.spring_record(100, start=each) for each in ((0.5, -0.4), (-0.3, 0.2))))
    simulator = make_model_simulator(latent_systems.make_model(memory=45), "spring", record)
    alone = ExtendedSimulator(simulator, (), make_context(record, simulator, 100))
    np.testing.assert_allclose(alone.simulate(alone.nominal), record.y, atol=1e-3)
    initial = [parameter.initial for parameter in alone.parameters]
    assert alone.recordings[initial].tolist() == [0, 0, 1, 1]
