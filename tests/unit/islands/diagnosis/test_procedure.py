"""Diagnosis: findings, rejected input, hold-out part and reproducibility."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from islands.diagnosis import assembly as diagnosis_assembly
from islands.diagnosis.calibration.preparation import MIN_SAMPLES
from islands.diagnosis.inference.finding import describe_effects
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import CATALOGUE
from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.report.documents.diagnosis_json import as_json, diagnosis_document
from islands.simulators.external import PythonFunctionSimulator, RecordedOutput
from lab.diagnosis.injection.measurement import inject
from lab.diagnosis.trial import TOLERANCE, Trial, run_trial
from support.built_in_simulators import make_piezo


@pytest.fixture(scope="module")
def record() -> Dataset:
    return inject(["quadratic-drag"], np.random.default_rng(8), seconds=6.0, band=(1.0, 4.0)).record


@pytest.fixture(scope="module")
def found(record: Dataset) -> Diagnosis:
    return diagnose(record, make_piezo(), TOLERANCE)


@pytest.mark.ci
def test_injected_drag_is_named_with_its_strength_and_gain(found: Diagnosis) -> None:
    assert found.verdict == Verdict.NAMED
    (finding,) = found.effects
    assert (finding.name, finding.family) == ("quadratic-drag", "shape")
    value = finding.parameters["c"]
    assert value.unit == "um s^2/V^2"
    assert value.ci95 is not None
    assert value.ci95[0] < value.value < value.ci95[1]
    assert finding.confidence > 0.9
    assert finding.explained_fraction is not None
    assert finding.explained_fraction > 0.95
    assert found.gain is not None
    assert found.gain.after.rmse == pytest.approx(0.135, rel=0.1)
    assert found.gain.ci95[0] < found.gain.reduction_percent < found.gain.ci95[1]
    assert found.gain.ci95[0] > 0.0
    assert found.gain.noise_floor.rmse == pytest.approx(0.135, rel=0.1)
    assert found.candidates[0].name == "quadratic-drag"


@pytest.mark.nightly
def test_diagnosis_is_reproducible(record: Dataset, found: Diagnosis) -> None:
    again = diagnose(record, make_piezo(), TOLERANCE)
    assert as_json(diagnosis_document(again)) == as_json(diagnosis_document(found))


@pytest.fixture(scope="module")
def clean() -> Dataset:
    return inject([], np.random.default_rng(9), seconds=6.0).record


#: A simulator with two parameters far from those of the records.
DETUNED = make_piezo(dp=1.3, A=0.7)


@pytest.mark.ci
def test_parameter_beyond_its_tolerance_is_a_discrepancy(clean: Dataset) -> None:
    found = diagnose(clean, DETUNED, TOLERANCE)
    assert {each.name for each in found.effects} <= {"wrong-parameter", "sensor-gain", "input-gain"}
    assert found.effects


def test_recorded_output_can_be_diagnosed(record: Dataset) -> None:
    simulated = np.array(make_piezo().simulate(*_nominal(record)))
    drifted = replace(
        record, y=simulated + 0.5 * record.time / record.time[-1] + 0.01 * np.sin(37.0 * record.time**2)
    )
    found = diagnose(drifted, RecordedOutput("theirs", simulated))
    assert [each.name for each in found.causes] == ["linear-drift"]
    assert found.effects[0].parameters["c"].value == pytest.approx(0.5, rel=0.05)


def test_cause_of_little_confidence_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis_assembly, "MIN_CONFIDENCE", 1.01)
    u = np.sin(np.arange(400.0))
    record = Dataset(u[:, None], 0.03 + u + 0.05 * np.random.default_rng(1).standard_normal(400), 1.0)
    found = diagnose(record, RecordedOutput("theirs", u), catalogue=[CATALOGUE["offset"]])
    assert (found.verdict, found.effects, found.gain) == (Verdict.UNKNOWN, (), None)
    assert found.candidates[0].name == "offset"
    assert found.best is found.base


@pytest.mark.nightly
def test_only_the_improbable_cause_of_several_is_not_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    def describe(*arguments: Any) -> tuple:
        findings, equivalents = describe_effects(*arguments)
        return (*findings[:-1], replace(findings[-1], confidence=0.03)), equivalents

    monkeypatch.setattr(diagnosis_assembly, "describe_effects", describe)
    k = np.arange(400.0)
    u, simulated = (
        np.sin(0.7 * k - lag) + gain * np.sin(0.093 * k) for lag, gain in ((0.0, 0.6), (0.8, 0.9))
    )
    y = simulated + 2e-3 * k + 0.1 * np.sin(0.37 * k) + 0.02 * np.random.default_rng(1).standard_normal(400)
    effects = [CATALOGUE["linear-drift"], CATALOGUE["periodic-disturbance"]]
    found = diagnose(Dataset(u, y, 1.0), RecordedOutput("theirs", simulated), catalogue=effects)
    assert [each.is_claimed for each in found.causes] == [True, False]
    assert found.verdict == Verdict.NAMED


def _nominal(record: Dataset) -> tuple:
    from islands.diagnosis.calibration.preparation import count_fitted_samples
    from islands.simulators.extended import make_context

    core = make_piezo()
    context = make_context(record, core, count_fitted_samples(record))
    return np.array([each.nominal for each in core.parameters]), context.u, context, {}, ()


UNUSABLE = {
    "too short": (lambda record: record[: MIN_SAMPLES - 1], f"a diagnosis needs at least {MIN_SAMPLES}"),
    "constant output": (lambda record: replace(record, y=0.0 * record.y), "column y_um is constant"),
    "gaps": (
        lambda record: replace(record, y=np.where(record.time > 4.4, record.y, np.nan)),
        "the output has 159 values in 600 samples",
    ),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_unusable_record_is_rejected(record: Dataset, case: str) -> None:
    spoil, message = UNUSABLE[case]
    with pytest.raises(RecordError, match=message):
        diagnose(spoil(record), make_piezo())


@pytest.mark.parametrize(
    ("tolerance", "message"),
    [
        ({"mass": 0.1}, "has no parameter 'mass': it has A, beta, gamma, dp"),
        ({"dp": 0.0}, "a fraction of its value, such as 0.02; got 0"),
        ({"dp": 2.0}, "a fraction of its value"),
    ],
)
def test_invalid_tolerance_is_rejected(record: Dataset, tolerance: dict, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        diagnose(record, make_piezo(), tolerance)


def test_tolerance_of_a_parameter_that_is_zero_is_rejected(record: Dataset) -> None:
    def function(u: np.ndarray, dt: float, offset: float = 0.0) -> np.ndarray:
        return u + offset * dt

    with pytest.raises(SettingsError, match="offset is a fraction of its value, which is 0"):
        diagnose(record, PythonFunctionSimulator(function, "function"), {"offset": 0.1})


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("effects", "core", "noise", "seed"),
    [
        # A hold fits better next to one of the effects alone, and makes the others half a sample early.
        (("rate-limit", "input-offset"), "cascaded-tanks", "white", 7750016),
        (("offset", "state-clip"), "cascaded-tanks", "white", 7750017),
        # A jump of many standard deviations is sharper than the step that is calibrated.
        (("ageing", "jump"), "cascaded-tanks", "white", 7750012),
        # The effects next to a discovered term lead to the third one.
        (("input-saturation", "cyclic-error", "ageing"), "cascaded-tanks", "white", 7996002),
        # The instants that the calibration starts from are many samples apart.
        (("thermal-drift", "gain-step"), "bouc-wen-piezo", "ar", 7990001),
        # With a linear input between samples, a resonance explains more than a delay.
        (("delay", "second-hysteresis", "exponential-creep"), "second-order", "white", 7996005),
        # A noise model takes the response to any two of the causes for noise.
        (("input-saturation", "ageing", "state-clip"), "cascaded-tanks", "white", 7996000),
        # A step that is slightly too large is made up for by a gain.
        (("sensor-gain", "quantised-input"), "bouc-wen-piezo", "white", 6996002),
        # A hold fits better next to two of the effects, and terms explain the third one.
        (("offset", "thermal-drift", "cyclic-error"), "cascaded-tanks", "white", 6999011),
        # The path of the hysteresis is that of an input that jumps between samples.
        (("stiction",), "bouc-wen-piezo", "white", 7996002),
    ],
)
def test_errors_of_the_calibration_are_no_further_causes(
    effects: tuple[str, ...], core: str, noise: str, seed: int
) -> None:
    found = run_trial(Trial(effects, seed, noise, (1.0, 4.0), core=core))
    assert found.exact
