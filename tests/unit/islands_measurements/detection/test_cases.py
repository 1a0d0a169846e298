"""Trial cases: nameable faults, the identified model, and the oracle."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.preparation import count_fitted_samples, select_effects
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.simulation.predictors import free_run
from islands.simulators.context import make_context
from islands_measurements.detection.cases import CASES, identify_actuator
from islands_measurements.detection.injection.measurement import inject
from islands_measurements.detection.injection.piezo import PIEZO
from islands_measurements.detection.oracle import score_oracle


@pytest.mark.parametrize("name", CASES)
def test_nameable_faults_are_those_with_an_effect(name: str) -> None:
    simulated = CASES[name]
    system = simulated.system
    faulty = inject(
        [], np.random.default_rng(4), system.seconds / 3, system=system, perturbed=simulated.perturbed
    )
    simulator = simulated.make(faulty)
    context = make_context(faulty.record, simulator, count_fitted_samples(faulty.record))
    effects = select_effects(simulator, context, simulated.tolerance)
    found = {effect.name.partition(":")[0] for effect in effects}
    assert set(simulated.nameable) == found & set(system.known)
    assert set(simulated.nameless) == (set(system.known) - found) | set(system.unknown)


def test_an_identified_model_follows_a_clean_record() -> None:
    """The model differs from the plant; its error is of the order of the noise."""
    faulty = inject([], np.random.default_rng(4), 40.0)
    record = faulty.record
    alone = type(record)(u=record.u[:, :1], y=record.y, dt=record.dt)
    model = identify_actuator(alone[:3000])
    missed = (free_run(model, alone).y - record.y)[model.maximum_lag :]
    assert np.std(missed[:3000]) < 1.5 * faulty.sigma
    assert np.std(missed[3000:]) < 2.5 * faulty.sigma
    assert model.size == 8


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    faulty = inject(["even-nonlinearity"], np.random.default_rng(4), 10.0, band=(2.0, 4.0), perturbed=False)
    return diagnose(faulty.record, CASES["column"].make(faulty))


@pytest.mark.ci
def test_a_correct_diagnosis_improves_as_much_as_the_oracle(found: Diagnosis) -> None:
    assert [effect.name for effect in found.effects] == ["even-nonlinearity"]
    assert score_oracle(found, ["even-nonlinearity"], {}).gain_share == pytest.approx(1.0, abs=0.02)


@pytest.mark.ci
def test_an_empty_diagnosis_has_no_improvement(found: Diagnosis) -> None:
    empty = replace(found, best=found.base)
    assert score_oracle(empty, ["even-nonlinearity"], {}).gain_share == 0.0


@pytest.mark.ci
def test_the_oracle_ratio_is_none_without_a_name_or_an_improvement(found: Diagnosis) -> None:
    assert score_oracle(found, ["delay"], {}).gain_share is None
    assert score_oracle(found, ["periodic-disturbance"], {}).gain_share is None


@pytest.mark.ci
def test_the_oracle_fits_two_faults_in_turn() -> None:
    faulty = inject(
        ["offset", "even-nonlinearity"], np.random.default_rng(6), 10.0, band=(1.0, 3.0), perturbed=False
    )
    found = diagnose(faulty.record, CASES["column"].make(faulty))
    score = score_oracle(found, ["offset", "even-nonlinearity"], {})
    assert score.gain_share == pytest.approx(1.0, abs=0.05)
    assert score.least_gain is not None
    assert score.least_gain > 100.0


@pytest.mark.ci
def test_a_fault_that_is_not_in_the_record_gains_nothing_next_to_another_one(found: Diagnosis) -> None:
    score = score_oracle(found, ["jump", "even-nonlinearity"], {})
    assert score.least_gain is not None
    assert score.least_gain < MIN_GAIN
    assert score_oracle(found, ["even-nonlinearity"], {}).least_gain is None


def test_the_piezo_case_uses_the_stated_tolerances() -> None:
    assert CASES["bouc-wen-piezo"].tolerance == {name: 2 * far for name, far in PIEZO.relative_error.items()}
