"""Plan and report of the trials with unusual causes."""

import json

import pytest

from islands.errors import SettingsError
from islands_measurements.detection.injection.unusual.table import UNUSUAL_CAUSES
from islands_measurements.detection.unusual_report import describe_failure, plan_unusual, report_unusual
from islands_measurements.detection.unusual_trial import Claim, FreshErrors, UnusualOutcome, UnusualTrial


def test_all_causes_are_planned_with_consecutive_seeds() -> None:
    planned = plan_unusual([], [], 2, 30)
    assert len(planned) == 2 * len(UNUSUAL_CAUSES)
    assert {each.seed for each in planned} == {30, 31}
    assert len(set(planned)) == len(planned)


def test_a_core_selects_the_causes_of_its_simulation() -> None:
    machine = {each.cause for each in plan_unusual(["second-order"], [], 1, 0)}
    process = {each.cause for each in plan_unusual(["linear"], [], 1, 0)}
    assert "late-friction" in machine
    assert "radiation" in process
    assert machine | process == set(UNUSUAL_CAUSES)
    assert not machine & process


def test_a_core_without_an_unusual_cause_is_rejected() -> None:
    with pytest.raises(SettingsError, match="no unusual cause has the core column: take second-order or"):
        plan_unusual(["column"], [], 1, 0)
    with pytest.raises(SettingsError, match="no unusual cause"):
        plan_unusual(["linear"], ["late-friction"], 1, 0)


def test_a_document_has_failing_claims_and_no_infinite_number() -> None:
    """The extension of the first outcome diverges."""
    claims = (Claim("second-hysteresis", "", 0.95), Claim("delay", "", 0.95))
    diverged = FreshErrors(9.0, float("inf"), 9.0, float("inf"))
    outcomes = [
        UnusualOutcome(UnusualTrial("dahl-friction", 8), 9.0, "named", claims, diverged),
        UnusualOutcome(UnusualTrial("clean-loop", 8), 0.0, "nothing"),
    ]
    document = json.loads(json.dumps(report_unusual(outcomes), allow_nan=False))
    assert document["answers"] == {"dahl-friction": {"right": 1}, "clean-loop": {"right": 1}}
    first, second = document["outcomes"]
    assert first["fresh"] == {"base": 9.0, "extended": None, "noisy_base": 9.0, "noisy_extended": None}
    assert (first["answer"], first["failing"]) == ("right", ["second-hysteresis", "delay"])
    assert (second["answer"], second["failing"]) == ("right", [])
    shares = {share["name"]: (share["count"], share["of"]) for share in document["shares"]}
    assert shares["extensions that make a fresh record worse or diverge"] == (1, 1)


def test_a_failure_is_described_with_its_seed_and_claims() -> None:
    trial = UnusualTrial("stick-slip", 8)
    claim = Claim("delay", "", 0.97)
    assert describe_failure(UnusualOutcome(trial, 9.0, "unknown")) is None
    wrong = UnusualOutcome(trial, 9.0, "named", (claim,), FreshErrors(9.0, 8.0, 9.0, 8.0))
    assert describe_failure(wrong) == (
        "stick-slip, seed 8, 9.0 sigma: wrong, verdict 'named': delay (0.97, fails); fresh error 9 to 8 sigma"
    )
    error = UnusualOutcome(trial, 9.0, "error", error="Traceback\n  line\nValueError: text\n")
    assert describe_failure(error) == (
        "stick-slip, seed 8, 9.0 sigma: error, verdict 'error': ValueError: text"
    )
