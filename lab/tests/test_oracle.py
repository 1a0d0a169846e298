"""Trial cases: nameable faults, the identified model, and the oracle."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from lab.diagnosis.cases import CASES
from lab.diagnosis.injection.measurement import inject
from lab.diagnosis.oracle import score_oracle


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    faulty = inject(["even-nonlinearity"], np.random.default_rng(4), 10.0, band=(2.0, 4.0), perturbed=False)
    return diagnose(faulty.record, CASES["column"].make(faulty))


def test_a_correct_diagnosis_improves_as_much_as_the_oracle(found: Diagnosis) -> None:
    assert [effect.name for effect in found.effects] == ["even-nonlinearity"]
    assert score_oracle(found, ["even-nonlinearity"], {}).gain_share == pytest.approx(1.0, abs=0.02)


def test_an_empty_diagnosis_has_no_improvement(found: Diagnosis) -> None:
    empty = replace(found, best=found.base)
    assert score_oracle(empty, ["even-nonlinearity"], {}).gain_share == 0.0


def test_the_oracle_fits_two_faults_in_turn() -> None:
    faulty = inject(
        ["offset", "even-nonlinearity"], np.random.default_rng(6), 10.0, band=(1.0, 3.0), perturbed=False
    )
    found = diagnose(faulty.record, CASES["column"].make(faulty))
    score = score_oracle(found, ["offset", "even-nonlinearity"], {})
    assert score.gain_share == pytest.approx(1.0, abs=0.05)
    assert score.least_gain is not None
    assert score.least_gain > 100.0
