"""Diagnosis of records with missing outputs: the same names as from the complete record."""

from functools import cache

import numpy as np
import pytest
import scipy

import islands
from islands.diagnosis.inference.noise_floor import noise_variance_from_periods
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.records.segments import count_runs, find_runs, split_at_gaps
from support.simulated_records import recorded, wave

RNG = np.random.default_rng(3)
SAMPLES = 600
U = wave(SAMPLES)
WHITE = 0.05 * RNG.standard_normal(SAMPLES)
COLOURED = scipy.signal.lfilter([0.6], [1.0, -0.8], WHITE)
NOISES = {"white": WHITE, "coloured": COLOURED}
DRIFT = 0.3 * np.arange(SAMPLES) / SAMPLES
EFFECTS = tuple(CATALOGUE[name] for name in ("offset", "linear-drift", "jump", "viscous", "cubic-stiffness"))

LOST: dict[str, np.ndarray] = {
    "every fifth sample": np.arange(SAMPLES) % 5 == 2,
    "a tenth at random": RNG.random(SAMPLES) < 0.1,
    "blocks, the first samples and the last": np.isin(np.arange(SAMPLES) // 15, (0, 9, 10, 22, 39)),
}


def lose(y: np.ndarray, case: str) -> Dataset:
    return recorded(U, np.where(LOST[case], np.nan, y))


def run(record: Dataset) -> Diagnosis:
    return islands.diagnose(record, "column:theirs", columns={"theirs": 0.8 * U}, effects=EFFECTS)


@cache
def run_complete(noise: str, moves: bool) -> Diagnosis:
    """Diagnose a record without gaps, which the cases share."""
    return run(recorded(U, 0.8 * U + moves * DRIFT + NOISES[noise]))


def name_causes(found: Diagnosis) -> list[str]:
    return [each.name for each in found.causes]


@pytest.mark.ci
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=pytest.mark.nightly)
        if case != "blocks, the first samples and the last"
        else case
        for case in LOST
    ],
)
@pytest.mark.parametrize("noise", ["white", pytest.param("coloured", marks=pytest.mark.nightly)])
def test_record_with_gaps_gives_the_names_of_the_complete_record(noise: str, case: str) -> None:
    for moves in (False, True):
        complete = run_complete(noise, moves)
        holed = run(lose(complete.record.y, case))
        assert name_causes(holed) == name_causes(complete) == (["linear-drift"] if moves else [])
        if noise == "white":
            assert holed.verdict == complete.verdict
        assert holed.noise_floor == pytest.approx(complete.noise_floor, rel=0.2)
        (finding,) = holed.record_findings
        assert finding.name == "missing-output"
        assert finding.parameters["share"][0] == pytest.approx(LOST[case].mean())


def test_runs_end_at_gaps_and_at_recordings() -> None:
    known = np.array([False, True, True, False, True, True, True, False])
    assert find_runs(known, (5, 3)) == ((1, 3), (4, 5), (5, 7))
    assert count_runs(known, (5, 3)) == (2, 1, 2)
    assert split_at_gaps(known, (5, 3)) == (1, 2, 1, 1, 2, 1)
    assert split_at_gaps(np.ones(8, bool), (5, 3)) == count_runs(np.ones(8, bool), (5, 3)) == (5, 3)


def test_noise_from_periods_skips_missing_samples() -> None:
    u = np.tile(np.sin(np.linspace(0, 2 * np.pi, 50, endpoint=False)), 8)
    y = u + 0.1 * np.random.default_rng(0).standard_normal(u.size)
    full = noise_variance_from_periods(u, y)
    holed = noise_variance_from_periods(u, np.where(np.arange(u.size) % 9 == 0, nan_like(y), y))
    assert holed == pytest.approx(full, rel=0.15)


def nan_like(signal: np.ndarray) -> np.ndarray:
    return np.full_like(signal, np.nan)
