"""Diagnosis: nothing is claimed below the resolution of a record, nor with an interval that contains zero."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import islands
from islands.diagnosis.calibration.resolution import is_unresolved
from islands.diagnosis.inference.resolved_effects import may_be_zero
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.simulators.external import RecordedOutput


def excite(seed: int, samples: int = 1500) -> np.ndarray:
    return np.asarray(lfilter([0.2], [1.0, -0.9], np.random.default_rng(seed).standard_normal(samples)))


def respond(u: np.ndarray) -> np.ndarray:
    return np.asarray(lfilter([0.0, 0.05, 0.05], [1.0, -1.6, 0.7], u))


def round_to(y: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(y / step)


def test_rounding_and_truncation_errors_are_on_both_sides_of_the_limit() -> None:
    fraction = np.random.default_rng(0).uniform(0.0, 1.0, 1000)
    assert is_unresolved(fraction - 0.5, 1.0)
    assert not is_unresolved(fraction, 1.0)


def test_joint_region_excludes_zero_where_each_interval_contains_it() -> None:
    values = np.array([1.0, 1.0])
    assert may_be_zero(values, np.eye(2))
    assert not may_be_zero(values, np.array([[1.0, -0.99], [-0.99, 1.0]]))
    assert may_be_zero(values[:1], np.eye(1))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("step", [1.0 / 256.0, 1e-4, 1e-9])
def test_rounded_output_of_the_simulation_has_no_cause(seed: int, step: float) -> None:
    u = excite(seed)
    y = respond(u)
    found = islands.diagnose(Dataset(u, round_to(y, step * float(np.ptp(y))), 0.01), "linear:2")
    assert (found.verdict, found.causes, found.gain) == (Verdict.NOTHING, (), None)
    assert {each.name for each in found.noise} <= {"quantisation"}


@pytest.mark.ci
def test_second_effect_below_the_resolution_is_not_named() -> None:
    u = excite(1)
    y = respond(u)
    measured = y + 0.1 + 1e-8 * np.linspace(0.0, 1.0, y.size)
    effects = [CATALOGUE["offset"], CATALOGUE["linear-drift"]]
    found = diagnose(Dataset(u, measured, 0.01), RecordedOutput("theirs", y), catalogue=effects)
    assert found.verdict == Verdict.NAMED
    assert [each.name for each in found.effects] == ["offset"]


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["zoh", "foh"])
@pytest.mark.parametrize("seed", range(3))
def test_exact_oscillator_has_neither_effects_nor_terms(method: str, seed: int) -> None:
    u = excite(seed, 2000)
    matrices = (
        np.array([[0.0, 1.0], [-400.0, -4.0]]),
        np.array([[0.0], [1.0]]),
        np.eye(1, 2),
        np.zeros((1, 1)),
    )
    a, b, c, d, _ = cont2discrete(matrices, 0.01, method=method)
    x, y = np.zeros(2), np.empty(u.size)
    for k, value in enumerate(u):
        y[k] = (c @ x)[0] + d[0, 0] * value
        x = a @ x + b[:, 0] * value
    found = islands.diagnose(Dataset(u, y, 0.01), "second-order")
    assert (found.verdict, found.effects, found.discovery) == (Verdict.NOTHING, (), None)
