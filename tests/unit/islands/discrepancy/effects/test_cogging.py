"""Cogging: a force that is periodic in the measured position."""

import numpy as np
import pytest

import islands
from islands.discrepancy.effects.cogging import COGGING
from islands.discrepancy.interfaces.context import ForceCoordinate, SimulationContext

#: Sampling time in seconds, integration steps per sample, and range of a slow motion in metres.
DT, STEPS, RANGE = 0.01, 5, 2.0

TIME = DT * np.arange(3000)


def make_axis_context(x: np.ndarray | None) -> SimulationContext:
    """Return the context of an axis whose measured position is ``x``."""
    coordinate = ForceCoordinate("m", RANGE / 2, 1.0, "N", 10.0, is_output=x is not None, measured=x)
    return SimulationContext(
        np.sin(TIME), DT, {}, {}, 10.0, 1.0, "N", "m", DT * TIME.size, force_coordinate=coordinate
    )


def find_frequencies(x: np.ndarray, residual: np.ndarray) -> list[float]:
    return [point[2] for point in COGGING.starting_points(make_axis_context(x), residual)]


def move_back_and_forth() -> np.ndarray:
    """Return a motion whose speed changes, so that a spatial frequency has many temporal ones."""
    return RANGE / 2 * np.sin(0.9 * TIME) * np.cos(0.13 * TIME)


@pytest.mark.parametrize("pitch", [0.02, 0.1, 0.4])
def test_starting_points_have_the_period_over_the_position(pitch: float) -> None:
    x = move_back_and_forth()
    noise = 0.5 * np.random.default_rng(1).standard_normal(x.size)
    found = find_frequencies(x, np.sin(2 * np.pi * x / pitch + 0.7) + noise)
    assert found[0] == pytest.approx(1.0 / pitch, abs=0.25 / RANGE)


def test_starting_points_ignore_the_level_and_trends_over_the_position() -> None:
    x = move_back_and_forth()
    found = find_frequencies(x, 7.0 + 0.3 * x + 0.2 * x**2 + 0.1 * np.sin(2 * np.pi * x / 0.1))
    assert found[0] == pytest.approx(10.0, abs=0.25 / RANGE)


def test_cogging_needs_a_measured_position_that_changes() -> None:
    assert COGGING.is_applicable(make_axis_context(move_back_and_forth()))
    assert not COGGING.is_applicable(make_axis_context(np.ones(TIME.size)))
    assert not COGGING.is_applicable(make_axis_context(None))


def simulate_axis(cogging: float, pitch: float, samples: int, rng: np.random.Generator) -> islands.Dataset:
    """Simulate ``2 x'' + 6 x' + 4 tanh(x'/0.05) + cogging sin(2 pi x/pitch) = u`` with noise of 0.2 %."""
    time, h = DT * np.arange(samples), DT / STEPS
    frequencies, phases = rng.uniform(0.2, 2.0, 12), rng.uniform(0.0, 6.3, 12)
    u = 10.0 * np.sin(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1) * np.minimum(1.0, time)
    pushed = np.interp(h * (0.5 + np.arange(samples * STEPS)), time, u).tolist()

    def accelerate(x: float, v: float, u: float) -> float:
        friction = 6.0 * v + 4.0 * np.tanh(v / 0.05)
        return float(u - friction - cogging * np.sin(2 * np.pi * x / pitch)) / 2.0

    x = v = 0.0
    y = np.empty(samples)
    for step, force in enumerate(pushed):
        if step % STEPS == 0:
            y[step // STEPS] = x
        middle_x, middle_v = x + h / 2 * v, v + h / 2 * accelerate(x, v, force)
        x, v = x + h * middle_v, v + h * accelerate(middle_x, middle_v, force)
    y += 0.002 * np.std(y) * rng.standard_normal(samples)
    return islands.Dataset(*(u, y, DT, ("u_N",)), output_name="x_m", input_units=("N",), output_unit="m")


@pytest.mark.ci
def test_cogging_of_an_axis_is_named_with_its_pitch() -> None:
    found = islands.diagnose(simulate_axis(1.0, 0.24, 1500, np.random.default_rng(3)), "rigid-axis")
    assert [each.name for each in found.effects] == ["cogging"]
    values = {name: each.value for name, each in found.effects[0].parameters.items()}
    assert values["frequency"] == pytest.approx(1.0 / 0.24, rel=0.01)
    assert np.hypot(values["cosine"], values["sine"]) == pytest.approx(1.0, abs=0.1)
