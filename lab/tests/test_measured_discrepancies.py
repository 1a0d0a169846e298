"""Diagnosis of measured records with known causes: named effects, and errors on unseen records."""

from functools import cache

import numpy as np
import pytest

import islands
from islands.diagnosis.inference.finding import Finding
from islands.diagnosis.result import Diagnosis
from lab.diagnosis.measured_discrepancies import CASES, DATA, errors

pytestmark = pytest.mark.timeout(600)


@cache
def diagnose(name: str) -> Diagnosis:
    """Diagnose a record of the benchmark; skip the test if the record is absent."""
    case = CASES[name]
    try:
        record = case.record()
    except FileNotFoundError as error:
        pytest.skip(f"needs a measured record in {DATA} ({error.filename}): set ISLANDS_MEASURED_DIR")
    return islands.diagnose(record, case.simulation)


def causes(found: Diagnosis) -> tuple[Finding, ...]:
    """Return the named effects except for the noise."""
    return found.causes


def names(found: Diagnosis) -> list[str]:
    return [each.name for each in causes(found)]


def get_errors(name: str) -> dict[str, list[float]]:
    """Return the errors on unseen records without and with the named effects."""
    found = diagnose(name)
    return errors(CASES[name], found.record, found)


def test_silverbox_has_a_cubic_spring() -> None:
    found = diagnose("silverbox")
    assert names(found)[0] == "cubic-stiffness"
    # The best published: 0.36, 0.26 and 0.32 mV.
    after = {name: row[1] for name, row in get_errors("silverbox").items()}
    assert after["multisine"] < 0.30
    assert after["arrow"] < 0.40
    assert after["arrow_noextrap"] < 0.33
    before = {name: row[0] for name, row in get_errors("silverbox").items()}
    assert min(before[name] / after[name] for name in after) > 10


def test_bouc_wen_benchmark_has_a_hysteresis_only() -> None:
    found = diagnose("bouc-wen")
    assert names(found) == ["second-hysteresis"]
    before, after = get_errors("bouc-wen")["multisine"]
    assert before > 100.0
    assert after < 1.0


def test_bouc_wen_benchmark_has_the_published_parameters() -> None:
    """Noel and Schoukens 2016: mass 2, alpha 5e4, beta gamma 800, beta delta -1100."""
    found = diagnose("bouc-wen")
    element = found.effects[0].parameters
    own = [parameter.name for parameter in found.best.simulation.simulator.parameters]
    mass = float(found.best.values[own.index("m")])
    official = {"k": 5e4, "chi": 800.0, "g": -1100.0}
    for name, value in official.items():
        assert element[name].value == pytest.approx(value, rel=0.01), name
    assert mass == pytest.approx(2.0, rel=0.01)


def test_tanks_have_an_overflow() -> None:
    found = diagnose("tanks")
    assert "state-clip" in names(found)
    assert len(names(found)) > 1
    before, after = get_errors("tanks")["val"]
    assert before > 0.6
    assert after < 0.30


@pytest.mark.parametrize("which", [2, 5])
def test_damper_has_a_hysteresis_or_dry_friction(which: int) -> None:
    found = diagnose(f"damper 0.8712 V {which}")
    assert names(found)[0] in ("second-hysteresis", "coulomb-friction")
    assert found.gain is not None
    assert found.gain.reduction_percent > 50


@pytest.mark.parametrize("name", ["furnace", "dryer"])
def test_missing_delay_of_a_linear_model_is_named(name: str) -> None:
    first = causes(diagnose(name))[0]
    assert "delay" in (first.name, *first.equivalents)


@pytest.mark.parametrize("name", ["furnace, delayed", "dryer, delayed"])
def test_linear_model_with_the_delay_has_no_effect(name: str) -> None:
    """The systems are linear."""
    found = diagnose(name)
    assert names(found) == []
    assert found.gain is None
    assert np.isfinite(found.noise_floor)
