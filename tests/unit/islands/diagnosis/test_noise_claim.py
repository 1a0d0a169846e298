"""Claims that a residual is noise: a stated noise level, and what is said without one."""

import json
from dataclasses import replace

import pytest

import islands
from islands.diagnosis.inference.verdict import Verdict
from support.levels import nightly_but
from support.noise_records import (
    SENSOR,
    make_day_wave,
    make_noisy_record,
    make_quantised_actuator,
    make_swept_force,
    respond,
)

#: Effects without those that describe an actuator that jumps, and without those whose frequency changes.
WITHOUT_JUMPS, WITHOUT_SWEEPS = (
    tuple(each for each in islands.EFFECTS if each.name not in names)
    for names in (("quantised-input", "stiction"), ("swept-disturbance", "swept-interference"))
)


def test_white_residual_is_nothing_unless_it_is_far_above_the_stated_noise() -> None:
    record = make_noisy_record("white", 0)
    found = islands.diagnose(record, "linear:2", effects=())
    assert found.verdict == Verdict.NOTHING
    assert found.noise_claim is not None
    assert found.noise_claim.correlation_time == 0.0
    rms = found.noise_claim.rms
    near = islands.diagnose(record, "linear:2", effects=(), noise_level=rms / 1.5)
    assert near.verdict == Verdict.NOTHING
    far = islands.diagnose(record, "linear:2", effects=(), noise_level=rms / 2.5)
    assert far.verdict == Verdict.UNKNOWN
    (finding,) = far.record_findings
    assert finding.name == "above-noise-level"
    assert "2.5 times the stated noise" in finding.description
    assert "Half of its energy is below" in finding.description


def test_rounding_is_nothing() -> None:
    record = make_noisy_record("white", 0)
    exact = replace(record, y=respond(record.u[:, 0]))
    assert islands.diagnose(exact, "linear:2", effects=()).verdict == Verdict.NOTHING


@pytest.mark.nightly
@pytest.mark.parametrize(
    "noise",
    ["slow", "pink", "in band", "steps"],
)
def test_clean_coloured_noise_is_left_to_the_user(noise: str) -> None:
    found = islands.diagnose(make_noisy_record(noise, 7), "linear:2")
    assert found.verdict == Verdict.NOISE
    assert not found.causes
    claim = found.noise_claim
    assert claim is not None
    assert json.loads(json.dumps(found.document))["noise_claim"]["rms"] == claim.rms
    stated = islands.diagnose(make_noisy_record(noise, 7), "linear:2", noise_level=claim.rms)
    assert stated.verdict == Verdict.NOTHING


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_an_error_over_the_input_without_a_name_is_no_noise(seed: int) -> None:
    found = islands.diagnose(make_quantised_actuator(seed), "linear:2", effects=WITHOUT_JUMPS)
    assert found.verdict == Verdict.UNKNOWN
    assert "fine map of the input" in found.residual_structure
    stated = islands.diagnose(
        make_quantised_actuator(seed), "linear:2", effects=WITHOUT_JUMPS, noise_level=SENSOR
    )
    assert stated.verdict == Verdict.UNKNOWN
    assert "above-noise-level" in [each.name for each in stated.record_findings]


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_a_line_that_moves_is_a_disturbance_with_a_name_or_unknown(seed: int) -> None:
    record = make_swept_force(seed)
    assert islands.diagnose(record, "linear:2").claimed_names[0] == "swept-disturbance"
    found = islands.diagnose(record, "linear:2", effects=WITHOUT_SWEEPS)
    assert found.verdict == Verdict.UNKNOWN
    assert "moving frequency" in found.residual_structure


@pytest.mark.nightly
def test_an_actuator_that_moves_in_steps_has_a_name() -> None:
    found = islands.diagnose(make_quantised_actuator(0), "linear:2")
    assert found.claimed_names[0] == "quantised-input"
    assert found.causes[0].parameters["step"].value == pytest.approx(0.6, rel=0.02)


@pytest.mark.ci
@pytest.mark.parametrize("seed", nightly_but([0], range(3)))
def test_day_wave_is_never_within_the_noise(seed: int) -> None:
    assert islands.diagnose(make_day_wave(seed), "linear:1").verdict not in (Verdict.NOTHING, Verdict.NAMED)
    stated = islands.diagnose(make_day_wave(seed), "linear:1", noise_level=0.1)
    assert stated.verdict not in (Verdict.NOTHING, Verdict.NOISE, Verdict.NAMED)
