"""Diagnosis of several recordings: common parameters, an initial state of each, whole recordings held out."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import CATALOGUE
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.split import MIN_RECORDING_SAMPLES
from support.joined_oscillator import SIGMA, oscillator_recordings

#: Effects that are searched for in a fast test.
FEW = tuple(CATALOGUE[name] for name in ("coulomb-friction", "cubic-stiffness", "offset", "jump", "delay"))


@pytest.fixture(scope="module")
def stiffened() -> Dataset:
    """Return three recordings of a hardening spring; the last two begin in the hold-out part."""
    return islands.join(oscillator_recordings(1, (600, 80, 120), "cubic-stiffness", 300.0))


@pytest.fixture(scope="module")
def found(stiffened: Dataset) -> Diagnosis:
    return islands.diagnose(stiffened, "second-order", effects=FEW[:3])


@pytest.mark.ci
def test_effect_is_named_and_predicts_whole_recordings(found: Diagnosis) -> None:
    assert found.verdict == Verdict.NAMED
    assert [each.name for each in found.effects] == ["cubic-stiffness"]
    assert found.effects[0].parameters["k"].value == pytest.approx(300.0, rel=0.01)
    assert found.estimation_samples == 600
    assert found.gain is not None
    assert found.gain.after.rmse == pytest.approx(SIGMA, rel=0.2)
    assert found.gain.before.rmse > 3 * SIGMA


@pytest.mark.ci
def test_held_out_recordings_do_not_change_the_estimate(stiffened: Dataset, found: Diagnosis) -> None:
    y = np.array(stiffened.y)
    y[found.estimation_samples :] *= 1.01
    other = islands.diagnose(replace(stiffened, y=y), "second-order", effects=FEW[:3])
    assert other.best.values[:3].tolist() == found.best.values[:3].tolist()
    assert other.candidates == found.candidates


@pytest.mark.ci
def test_recording_that_is_held_out_as_a_whole_is_no_part_of_an_estimate() -> None:
    parts = oscillator_recordings(1, (400, 300), "cubic-stiffness", 300.0)
    other = replace(parts[1], y=parts[1].y + 0.01)
    one, two = (
        islands.diagnose(parts[0], "second-order", validation=each, effects=FEW[:3])
        for each in (parts[1], other)
    )
    assert [each.name for each in one.effects] == ["cubic-stiffness"]
    assert one.estimation_samples == 400
    assert one.held_out_part == "the validation recording"
    np.testing.assert_array_equal(one.best.values[:4], two.best.values[:4])
    assert one.gain is not None
    assert one.gain.after.rmse == pytest.approx(SIGMA, rel=0.2)
    # The offset of the other recording is an error that no effect of the first one explains.
    assert two.gain is None or two.gain.after.rmse > 2 * SIGMA


@pytest.mark.nightly
def test_change_between_two_recordings_is_a_jump_at_the_boundary() -> None:
    first, second = oscillator_recordings(5, (500, 300))
    record = islands.join((first, replace(second, y=second.y + 0.005)))
    found = islands.diagnose(record, "second-order", effects=FEW)
    # The modelled jump takes a few samples, and this one none.
    assert [each.name for each in found.effects if each.explained_fraction] == ["jump"]
    assert found.effects[0].parameters["c"].value == pytest.approx(0.005, rel=0.05)
    assert found.effects[0].parameters["instant"].value == pytest.approx(5.0, abs=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [4, 5])
def test_complete_catalogue_names_friction_only_if_there_is_some(seed: int) -> None:
    with_friction = islands.join(oscillator_recordings(seed, effect="coulomb-friction", value=0.5))
    found = islands.diagnose(with_friction, "second-order")
    assert [each.name for each in found.effects] == ["coulomb-friction"]
    assert found.effects[0].parameters["F"].value == pytest.approx(0.5, rel=0.03)
    clean = islands.diagnose(islands.join(oscillator_recordings(seed)), "second-order")
    assert clean.verdict == Verdict.NOTHING


def test_short_recording_is_rejected() -> None:
    first, second = oscillator_recordings(1, (300, 50))
    record = islands.join((first, second[: MIN_RECORDING_SAMPLES - 1]))
    with pytest.raises(
        RecordError, match="recording 2 has 19 samples, and a diagnosis of several recordings"
    ):
        islands.diagnose(record, "second-order")
    assert count_fitted_samples(islands.join((first, second[:MIN_RECORDING_SAMPLES]))) == 240
