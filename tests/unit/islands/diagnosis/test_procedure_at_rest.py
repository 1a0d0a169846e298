"""Diagnosis of records with a resting input: creep tests, decays, held valves."""

import numpy as np
import pytest

import islands
from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.records.dataset import Dataset
from islands.report.documents.extension_json import extended_document
from support.simulated_records import recorded

SAMPLES, DT = 400, 0.1
TIME = DT * np.arange(SAMPLES)
CREEP = 0.5 * (1.0 - np.exp(-TIME / 8.0))


def static(u: np.ndarray, _dt: float, k: float = 0.8) -> np.ndarray:
    return k * u


def rest(level: float, motion: np.ndarray) -> Dataset:
    noise = 0.01 * np.random.default_rng(4).standard_normal(SAMPLES)
    return recorded(np.full(SAMPLES, level), 0.8 * level + motion + noise, DT)


MOTIONS = {
    "exponential-creep": CREEP,
    "logarithmic-creep": 0.1 * sum(1.0 - np.exp(-TIME / tau) for tau in (0.3, 1.0, 3.0, 10.0, 30.0)),
    "linear-drift": 0.3 * TIME / TIME[-1],
}

#: Motions and levels of the input that are diagnosed for every change.
ESSENTIAL = (("exponential-creep", 50.0), ("exponential-creep", 0.0))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "level"),
    [
        pytest.param(name, level, marks=() if (name, level) in ESSENTIAL else pytest.mark.nightly)
        for name in MOTIONS
        for level in (50.0, 0.1, 0.0)
    ],
)
def test_motion_at_a_resting_input_is_named(name: str, level: float) -> None:
    found = islands.diagnose(
        rest(level, MOTIONS[name]), islands.function_simulator(static), tolerance={"k": 0.001}
    )
    assert found.effects[0].name == name
    assert found.gain is not None
    assert found.gain.after.rmse == pytest.approx(0.01, rel=0.3)
    if name == "exponential-creep":
        assert found.effects[0].parameters["log_tau"].value == pytest.approx(np.log(8.0), abs=0.15)


def test_extended_simulation_of_a_creep_test_repeats_the_creep() -> None:
    record = rest(50.0, CREEP)
    found = islands.diagnose(
        record,
        "column:theirs",
        columns={"theirs": 0.8 * record.u[:, 0]},
        effects=[CATALOGUE["exponential-creep"]],
    )
    repeated = islands.simulate(
        extended_document(found.best, found.record), record, columns={"theirs": 0.8 * record.u[:, 0]}
    )
    np.testing.assert_allclose(repeated.y, found.best.output, rtol=1e-9)


def test_output_that_rests_at_a_held_input_has_lost_no_samples() -> None:
    """A valve repeats its output between steps; at a moving input, a repeated value is a loss."""
    u = np.repeat(np.random.default_rng(1).standard_normal(20), 20)
    y = np.where(np.arange(u.size) % 20 < 8, u + np.linspace(0.0, 1.0, u.size), u)
    contexts = (SimulationContext(x, DT, {}, {}, 1.0, 1.0, "V", "um", 40.0) for x in (u, TIME))
    detections = [DETECTORS["held-samples"].detect(y, 0.1 * y, context) for context in contexts]
    assert detections[0] is None
    assert detections[1] is not None
