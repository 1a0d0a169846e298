"""Ends of free curves that a record does not determine are flat; those that it determines remain."""

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.curve_ends import MAX_INCREASE, flatten_ends
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import RecordedOutput

SAMPLES = 800


def fit_curve(seed: int, narrow: bool) -> tuple[Hypothesis, Target]:
    """Fit a curve of the output to |x|, with samples in all of its range, or two outside of a third."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, SAMPLES)
    x[0], x[1] = 1.0, -1.0
    if narrow:
        x[2:] *= 0.3
    y = x + 0.5 * np.abs(x) + 0.05 * rng.standard_normal(SAMPLES)
    record, simulator = Dataset(x, y, 0.1), RecordedOutput("theirs", x)
    target, form = make_target(record, 600, {}), CATALOGUE["output-curve"]
    simulation = ExtendedSimulator(simulator, (form,), make_context(record, simulator, 600))
    fit = calibrate(simulation, target, simulation.nominal)
    return Hypothesis(fit, fit.score, (form,)), target


@pytest.mark.parametrize("seed", range(5))
def test_ends_without_samples_are_flat(seed: int) -> None:
    hypothesis, target = fit_curve(seed, narrow=True)
    flat = flatten_ends(hypothesis, target)
    before, after = hypothesis.fit.values, flat.fit.values
    assert after[0] == after[1]
    assert after[-1] == after[-2]
    assert np.abs(after).max() < np.abs(before).max()
    assert flat.cost < hypothesis.cost + 4 * MAX_INCREASE
