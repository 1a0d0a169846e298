"""Diagnosis of records with a resting input: creep tests, decays, held valves."""

import numpy as np

import islands
from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from support.simulated_records import recorded

SAMPLES, DT = 400, 0.1
TIME = DT * np.arange(SAMPLES)
CREEP = 0.5 * (1.0 - np.exp(-TIME / 8.0))


def rest(level: float, motion: np.ndarray) -> Dataset:
    noise = 0.01 * np.random.default_rng(4).standard_normal(SAMPLES)
    return recorded(np.full(SAMPLES, level), 0.8 * level + motion + noise, DT)


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
