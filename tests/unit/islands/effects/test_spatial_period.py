"""Forces and errors of the sensor that are periodic in the measured position."""

import numpy as np
import pytest

import islands
from islands.effects.interface.context import ForceCoordinate, SimulationContext
from islands.effects.interface.effect import Effect
from islands.effects.spatial_period import COGGING, CYCLIC_ERROR

#: Sampling time in seconds, integration steps per sample, and range of a slow motion in metres.
DT, STEPS, RANGE = 0.01, 5, 2.0

TIME = DT * np.arange(3000)

EFFECTS = (COGGING, CYCLIC_ERROR)


def make_axis_context(x: np.ndarray | None) -> SimulationContext:
    """Return the context of an axis whose measured position is ``x``."""
    coordinate = ForceCoordinate("m", RANGE / 2, 1.0, "N", 10.0, is_output=True)
    return SimulationContext(
        *(np.sin(TIME), DT, {}, {}, 10.0, 1.0, "N", "m", DT * TIME.size),
        force_coordinate=coordinate,
        measured=x,
    )


def find_frequencies(effect: Effect, x: np.ndarray, residual: np.ndarray) -> list[float]:
    return [point[2] for point in effect.starting_points(make_axis_context(x), residual)]


def move_back_and_forth() -> np.ndarray:
    """Return a motion whose speed changes, so that a spatial frequency has many temporal ones."""
    return RANGE / 2 * np.sin(0.9 * TIME) * np.cos(0.13 * TIME)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
@pytest.mark.parametrize("pitch", [0.02, 0.1, 0.15])
def test_starting_points_have_the_period_over_the_position(effect: Effect, pitch: float) -> None:
    x = move_back_and_forth()
    noise = 0.5 * np.random.default_rng(1).standard_normal(x.size)
    found = find_frequencies(effect, x, np.sin(2 * np.pi * x / pitch + 0.7) + noise)
    assert found[0] == pytest.approx(1.0 / pitch, abs=0.25 / RANGE)


@pytest.mark.parametrize("seed", range(6))
def test_a_cyclic_error_has_its_line_over_the_simulated_position(seed: int) -> None:
    """The reading falls where the position rises; the simulated position has the line."""
    x, pitch = move_back_and_forth()[::8], 0.1
    error = 1.8 * pitch / (2 * np.pi) * np.sin(2 * np.pi * x / pitch)
    noise = 0.5 * np.std(error) * np.random.default_rng(seed).standard_normal(x.size)
    found = find_frequencies(CYCLIC_ERROR, x + error + noise, error + noise)
    assert np.min(np.abs(np.array(found) - 1.0 / pitch)) < 0.25 / RANGE


@pytest.mark.ci
@pytest.mark.parametrize("is_fast", [False, True])
def test_the_cyclic_error_of_an_encoder_is_named_with_its_period(is_fast: bool) -> None:
    """The simulation is a gain; the error is three tenths of the noise. A fast axis skips periods."""
    rng = np.random.default_rng(5)
    u = rng.standard_normal(2000)
    u = u if is_fast else np.cumsum(u) * np.hanning(2000)
    y = 0.8 * u
    noise = 0.01 * float(np.std(y))
    pitch = 0.07 * float(np.ptp(y))
    y = y + 0.45 * noise * np.sin(2 * np.pi * y / pitch + 1.0) + noise * rng.standard_normal(u.size)
    record = islands.Dataset(*(u, y, 0.001, ("u_V",)), output_name="y_um")
    found = islands.diagnose(record, "linear:0")
    assert [each.name for each in found.effects] == ["cyclic-error"]
    values = {name: each.value for name, each in found.effects[0].parameters.items()}
    assert values["frequency"] * pitch == pytest.approx(1.0, rel=0.01)
    assert np.hypot(values["cosine"], values["sine"]) / noise == pytest.approx(0.45, abs=0.1)
