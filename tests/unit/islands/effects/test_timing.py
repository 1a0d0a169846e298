"""Effects on time: a delay that swings, and a lag that grows with its error."""

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.effects.interface.context import SimulationContext
from islands.effects.timing import VARYING_DELAY
from islands.kernels.lagrange import interpolate_at
from islands.kernels.memory_operators import lag_by_gap

DT, SAMPLES = 0.1, 1500

TIME = DT * np.arange(SAMPLES)


def draw_levels(seed: int) -> np.ndarray:
    """Return random levels, each held for some seconds."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-2.0, 2.0, SAMPLES // 15), rng.integers(15, 60, SAMPLES // 15))[:SAMPLES]


def follow(u: np.ndarray) -> np.ndarray:
    """Return the output of a process with a time constant of 2 s and a gain of 1.5."""
    pole = float(np.exp(-DT / 2.0))
    return np.asarray(lfilter([0.0, 1.5 * (1.0 - pole)], [1.0, -pole], u))


def swing(u: np.ndarray, mean: float, amplitude: float, frequency: float) -> np.ndarray:
    late = mean + amplitude * np.sin(2 * np.pi * frequency * TIME + 0.4)
    return np.asarray(interpolate_at(u, np.arange(SAMPLES) - late / DT))


def make_context(u: np.ndarray, measured: np.ndarray) -> SimulationContext:
    return SimulationContext(u, DT, {}, {}, 2.0, 3.0, "V", "V", 112.5, measured=measured)


@pytest.mark.parametrize("frequency", [0.02, 0.035, 0.1])
def test_a_delay_that_swings_starts_with_its_frequency(frequency: float) -> None:
    u = draw_levels(1)
    simulated, measured = follow(u), follow(swing(u, 0.0, 0.3, frequency))
    points = VARYING_DELAY.starting_points(make_context(u, measured), measured - simulated)
    for _, cosine, sine, found in points:
        assert found == pytest.approx(frequency, abs=0.002)
        assert np.hypot(cosine, sine) == pytest.approx(0.3, rel=0.4)


def diagnose(u: np.ndarray, y: np.ndarray) -> islands.DiagnosisResult:
    noise = 0.01 * y.std() * np.random.default_rng(3).standard_normal(y.size)
    record = islands.Dataset(u[:, None], y + noise, DT, ("u_V",), "y_V", ("V",), "V")
    return islands.diagnose(record, "linear:1")


@pytest.mark.nightly
def test_a_delay_that_swings_is_named_with_its_values() -> None:
    u = draw_levels(4)
    found = diagnose(u, follow(swing(u, 0.7, 0.4, 0.02)))
    assert (str(found.verdict), found.claimed_names) == ("named", ("varying-delay",))
    values = found.effects[0].parameters
    assert values["mean"].value == pytest.approx(0.7, abs=0.03)
    assert values["frequency"].value == pytest.approx(0.02, abs=0.0005)
    assert np.hypot(values["cosine"].value, values["sine"].value) == pytest.approx(0.4, abs=0.03)


@pytest.mark.nightly
def test_a_lag_that_grows_with_its_error_is_named_and_holds_on_another_record() -> None:
    u = draw_levels(5)
    found = diagnose(u, lag_by_gap(follow(u), DT, 0.7, 1.4))
    assert (str(found.verdict), found.claimed_names) == ("named", ("growing-lag",))
    values = found.effects[0].parameters
    assert values["tau"].value == pytest.approx(0.7, rel=0.1)
    assert values["inverse_rate"].value == pytest.approx(1.4, rel=0.1)
    u = draw_levels(6)
    other = islands.Dataset(u[:, None], lag_by_gap(follow(u), DT, 0.7, 1.4), DT, ("u_V",), "y_V", ("V",), "V")
    assert np.std(found.simulate(other).y - other.y) < 0.01 * other.y.std()
