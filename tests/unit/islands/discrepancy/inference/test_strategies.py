"""Evidence by misfit: two causes of a simulation whose form is wrong."""

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import Target, calibrate
from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.inference.strategies import assess_evidence, search_with_model_error
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.evolution.progress import ignore_progress
from islands.io.simulator_spec.factory import make_simulator
from islands.io.simulator_spec.specification import PhysicalSpec
from support.simulated_records import recorded

#: Level at which the upper tank overflows, and what the pump brings beside what it is told.
RIM, BESIDE = 4.0, 0.8

#: What is looked for beside the tanks' own effects: at the fast level, and at the nightly level.
RIVALS = (
    ("offset",),
    pytest.param(
        ("delay", "input-saturation", "exponential-creep", "output-saturation", "offset"),
        marks=pytest.mark.nightly,
    ),
)


def overflowing(rim: float, beside: float, samples: int = 400, dt: float = 4.0) -> Dataset:
    """Integrate two tanks in small Euler steps; a part of what goes over the upper rim is caught below."""
    rng = np.random.default_rng(12)
    pump = np.repeat(rng.uniform(0.5, 5.5, samples // 30 + 1), 30)[:samples]
    pump = np.convolve(pump, np.ones(15) / 15, "same")
    upper, lower, y, often = 2.0, 2.0, [], 40
    for k in range(samples):
        y.append(lower)
        for step in range(often):
            told = pump[k] + (pump[min(k + 1, samples - 1)] - pump[k]) * step / often
            through, out = 0.06 * np.sqrt(upper), 0.05 * np.sqrt(lower)
            upper += dt / often * (0.03 * (told + beside) - through)
            over = max(upper - rim, 0.0)
            upper -= over
            lower = max(lower + dt / often * (through - out) + 0.4 * over, 0.0)
    return recorded(pump, np.array(y) + 0.01 * rng.standard_normal(samples), dt, ("V", "V"))


@pytest.fixture(scope="module", params=RIVALS, ids=len)
def weighed(request):
    record = overflowing(RIM, BESIDE)
    core = make_simulator(PhysicalSpec(kind="cascaded-tanks"), record)
    fitted = count_fitted_samples(record)
    alone = ExtendedSimulator(core, (), make_context(record, core, fitted))
    target = Target(record.y, np.arange(record.samples) < fitted, None, {})
    base = calibrate(alone, target, alone.nominal)
    effects = [*core.state_effects, *(CATALOGUE[name] for name in request.param)]
    evidence = search_with_model_error(base, target, effects, ignore_progress, map)
    return record, fitted, evidence, assess_evidence(evidence, fitted, np.random.default_rng(0))


def test_both_causes_are_found(weighed) -> None:
    record, fitted, _, evidence = weighed
    causes = {effect.name for effect in evidence.hypothesis.effects}
    assert "state-clip:upper" in causes
    assert evidence.verdict in (Verdict.NAMED, Verdict.REMAINDER)
    locked = slice(fitted, record.samples)
    before, after = (
        float(np.sqrt(np.mean((record.y - fit.output)[locked] ** 2)))
        for fit in (evidence.base, evidence.hypothesis.fit)
    )
    assert after < 0.2 * before


def test_neighbours_count_for_less_where_the_form_is_wrong(weighed) -> None:
    _, fitted, evidence, _ = weighed
    assert evidence.target.effective_samples is not None
    assert 10.0 <= evidence.target.effective_samples < fitted
    assert evidence.base.noise.order == 0
    assert evidence.base.noise.effective_samples == evidence.target.effective_samples
