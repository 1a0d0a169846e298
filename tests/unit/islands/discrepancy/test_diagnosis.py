"""A diagnosis: what it names, what it refuses, what it does not see, and that it is the same each time."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import Dataset, join
from islands.discrepancy.calibration.preparation import FEWEST, LOCKED
from islands.discrepancy.diagnosis import Diagnosis, diagnose
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.errors import RecordError, SettingsError
from islands.io.diagnosis_json import as_json, diagnosis_document
from islands.performance.trials.injection.measurement import inject
from islands.performance.trials.trial import TOLERANCE
from islands.systems.bouc_wen import BoucWenPiezo


@pytest.fixture(scope="module")
def record() -> Dataset:
    return inject(["quadratic-drag"], np.random.default_rng(8), seconds=6.0, band=(1.0, 4.0)).record


@pytest.fixture(scope="module")
def found(record: Dataset) -> Diagnosis:
    return diagnose(record, BoucWenPiezoSimulator(), TOLERANCE)


def changed(record: Dataset, column: int, values: object) -> Dataset:
    u = np.array(record.u)
    u[:, column] = values
    return replace(record, u=u)


def test_what_was_hidden_is_named_with_its_strength_and_what_it_is_worth(found: Diagnosis) -> None:
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


@pytest.mark.ci
def test_the_same_question_has_the_same_answer(record: Dataset, found: Diagnosis) -> None:
    again = diagnose(record, BoucWenPiezoSimulator(), TOLERANCE)
    assert as_json(diagnosis_document(again)) == as_json(diagnosis_document(found))


def test_what_is_locked_away_is_seen_by_the_gain_alone(record: Dataset, found: Diagnosis) -> None:
    y = np.array(record.y)
    fitted = int((1 - LOCKED) * record.samples)
    y[fitted:] += 1.0
    other = diagnose(replace(record, y=y), BoucWenPiezoSimulator(), TOLERANCE)
    assert (other.effects, other.candidates, other.verdict) == (
        found.effects,
        found.candidates,
        found.verdict,
    )
    assert other.gain is not None
    assert found.gain is not None
    assert other.gain.after.rmse > 5 * found.gain.after.rmse


@pytest.fixture(scope="module")
def clean() -> Dataset:
    return inject([], np.random.default_rng(9), seconds=6.0).record


#: A simulation with two parameters that are far from those of the records.
OFF = BoucWenPiezoSimulator(BoucWenPiezo(dp=1.3, A=0.7))


def test_a_parameter_without_a_tolerance_is_calibrated_and_no_discrepancy(clean: Dataset) -> None:
    assert diagnose(clean, OFF).verdict == Verdict.NOTHING


def test_a_parameter_beyond_its_tolerance_is_a_discrepancy(clean: Dataset) -> None:
    trusted = diagnose(clean, OFF, TOLERANCE)
    assert {each.name for each in trusted.effects} <= {"wrong-parameter", "sensor-gain", "input-gain"}
    assert trusted.effects


def test_a_column_is_a_simulation(record: Dataset) -> None:
    simulated = np.array(BoucWenPiezoSimulator().simulate(*_nominal(record)))
    drifted = replace(
        record, y=simulated + 0.5 * record.time / record.time[-1] + 0.01 * np.sin(37.0 * record.time**2)
    )
    found = diagnose(drifted, RecordedOutput("theirs", simulated))
    assert [each.name for each in found.effects if each.explained_fraction is not None] == ["linear-drift"]
    assert found.effects[0].parameters["c"].value == pytest.approx(0.5, rel=0.05)


def _nominal(record: Dataset) -> tuple:
    from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context

    core = BoucWenPiezoSimulator()
    scene = make_context(record, core, count_fitted_samples(record))
    return np.array([each.nominal for each in core.parameters]), scene.u, scene, {}, ()


REFUSED = {
    "short": (lambda record: record[: FEWEST - 1], f"a diagnosis takes {FEWEST} at least"),
    "still": (lambda record: changed(record, 0, 1.0), "column u_V is constant"),
    "still channel": (lambda record: changed(record, 2, 1.0), "column w_V is constant"),
    "twin": (
        lambda record: changed(record, 1, record.u[:, 0]),
        "channel T_K is the input itself: leave it out",
    ),
    "gaps": (lambda record: replace(record, y=np.where(record.time > 3, record.y, np.nan)), "has gaps"),
    "several": (lambda record: join((record, record)), "diagnose one after the other"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_record_that_cannot_be_used_is_refused(record: Dataset, case: str) -> None:
    spoil, why = REFUSED[case]
    with pytest.raises(RecordError, match=why):
        diagnose(spoil(record), BoucWenPiezoSimulator())


@pytest.mark.parametrize(
    ("tolerance", "why"),
    [
        ({"mass": 0.1}, "has no parameter 'mass': it has A, beta, gamma, dp"),
        ({"dp": 0.0}, "a part of its value, like 0.02; got 0"),
        ({"dp": 2.0}, "a part of its value"),
    ],
)
def test_a_tolerance_that_cannot_be_is_refused(record: Dataset, tolerance: dict, why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        diagnose(record, BoucWenPiezoSimulator(), tolerance)


def test_a_simulation_that_diverges_is_refused(record: Dataset) -> None:
    with pytest.raises(RecordError, match="diverges on this input"), np.errstate(all="ignore"):
        diagnose(record, BoucWenPiezoSimulator(BoucWenPiezo(gamma=-5.0)))
