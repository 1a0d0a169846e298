"""Search under model error: two causes in a simulation whose form is wrong."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.inference.strategies import assess_evidence, search_with_model_error
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import recorded

#: Level at which the upper tank overflows.
RIM = 4.0

#: Constant flow of the pump in addition to its command.
EXTRA_FLOW = 0.8

#: Effects searched for in addition to those of the tanks: at the fast level, and at the nightly level.
CATALOGUES = (
    ("offset",),
    pytest.param(
        ("delay", "input-saturation", "exponential-creep", "output-saturation", "offset"),
        marks=pytest.mark.nightly,
    ),
)


def simulate_overflow(rim: float, extra_flow: float, samples: int = 400, dt: float = 4.0) -> Dataset:
    """Integrate two tanks in small Euler steps; a part of the upper tank's overflow enters the lower tank."""
    rng = np.random.default_rng(12)
    pump = np.repeat(rng.uniform(0.5, 5.5, samples // 30 + 1), 30)[:samples]
    pump = np.convolve(pump, np.ones(15) / 15, "same")
    upper, lower, y, steps = 2.0, 2.0, [], 40
    for k in range(samples):
        y.append(lower)
        for step in range(steps):
            command = pump[k] + (pump[min(k + 1, samples - 1)] - pump[k]) * step / steps
            through, out = 0.06 * np.sqrt(upper), 0.05 * np.sqrt(lower)
            upper += dt / steps * (0.03 * (command + extra_flow) - through)
            over = max(upper - rim, 0.0)
            upper -= over
            lower = max(lower + dt / steps * (through - out) + 0.4 * over, 0.0)
    return recorded(pump, np.array(y) + 0.01 * rng.standard_normal(samples), dt, ("V", "V"))


@pytest.fixture(scope="module", params=CATALOGUES, ids=len)
def assessed(request):
    record = simulate_overflow(RIM, EXTRA_FLOW)
    core = make_simulator(PhysicalSpec(kind="cascaded-tanks"), record)
    fitted = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, fitted))
    target = make_target(record, fitted, {})
    base = calibrate(simulation, target, simulation.nominal)
    effects = [*core.state_effects, *(CATALOGUE[name] for name in request.param)]
    run = DiagnosisRun(effects)
    outcome = search_with_model_error(base, target, run)
    return record, fitted, outcome, assess_evidence(outcome, run)


@pytest.mark.ci
def test_overflow_is_found_and_reduces_the_error(assessed) -> None:
    record, fitted, _, outcome = assessed
    causes = {effect.name for effect in outcome.hypothesis.effects}
    assert "state-clip:upper" in causes
    assert outcome.verdict in (Verdict.NAMED, Verdict.REMAINDER)
    locked = slice(fitted, record.samples)
    before, after = (
        float(np.sqrt(np.mean((record.y - fit.output)[locked] ** 2)))
        for fit in (outcome.base, outcome.hypothesis.fit)
    )
    assert after < 0.2 * before


@pytest.mark.nightly
def test_model_error_reduces_the_effective_sample_size(assessed) -> None:
    _, fitted, outcome, _ = assessed
    assert outcome.target.effective_samples is not None
    assert 10.0 <= outcome.target.effective_samples < fitted
    assert outcome.base.noise.order == 0
    assert outcome.base.noise.effective_samples == outcome.target.effective_samples


def test_lines_that_are_fitted_to_noise_do_not_make_it_model_error() -> None:
    """They explain more of it than of its surrogates, so that coloured residuals would be searched."""
    rng = np.random.default_rng(4)
    u, noise = (lfilter([1.0], [1.0, -pole], rng.standard_normal(600)) for pole in (0.8, 0.9))
    record = recorded(u, lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.1 * noise, 0.1, ("V", "V"))
    core = make_simulator("linear:1", record)
    fitted = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, fitted))
    target = make_target(record, fitted, {})
    base = calibrate(simulation, target, simulation.nominal)
    effects = [CATALOGUE[name] for name in ("swept-disturbance", "swept-interference", "varying-delay")]
    assert all(each.is_tuned for each in effects)
    run = DiagnosisRun(effects)
    outcome = search_with_model_error(base, target, run)
    assert (outcome.screened, outcome.hypothesis.effects) == ((), ())
