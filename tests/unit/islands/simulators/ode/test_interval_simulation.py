"""Intervals that are simulated side by side have the bits of separate simulations."""

from dataclasses import replace

import numpy as np
import pytest

from islands.simulators.ode.interval_simulation import IntervalSimulation
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.native import code as native_code
from islands.simulators.ode.program import OdeProgram, generate_program
from islands.simulators.ode.sampled_signal import SampledSignal, make_time
from islands.simulators.ode.system_document import make_system

DT, SAMPLES, INTERVAL = 0.01, 110, 24
INTERVALS = 5
MOTION = {
    "name": "motion",
    "input": "F",
    "equations": """
        dx/dt = v
        dv/dt = F - c*v - 80*x - rate(F)*0.01 + sin(3*t)
        dz/dt = x - z
    """,
    "output": "x + 0.1*F",
    "parameters": {"c": 1.2},
}


@pytest.fixture(params=["interpreted", "native"])
def program(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> OdeProgram:
    text = MOTION["equations"].replace("sin(3*t)", "t") if request.param == "native" else MOTION["equations"]
    monkeypatch.setattr(native_code, "COMPILED_FROM", 0)
    return generate_program(make_system({**MOTION, "equations": text}))


def make_lanes() -> list[LaneInput]:
    """Make lanes with different parameters and limits; the last one has another input."""
    signals = [SampledSignal(np.random.default_rng(seed).standard_normal((SAMPLES, 3))) for seed in (0, 1)]
    time = make_time(2.0, SAMPLES, DT)
    initial = {"x": 0.0, "v": 0.0, "z": 0.0}
    lanes = [LaneInput({"c": 0.1 * index}, initial, {"F": signals[0], **time}) for index in range(7)]
    lanes[2] = replace(lanes[2], limits={"x": (-0.1, 0.1)})
    return [*lanes, replace(lanes[1], signals={"F": signals[1], **time})]


def take_interval(lane: LaneInput, number: int, states: np.ndarray) -> LaneInput:
    """Return the lane of one interval that starts at given states."""
    part = slice(number * INTERVAL, (number + 1) * INTERVAL)
    signals = {name: SampledSignal(each.moments[part]) for name, each in lane.signals.items()}
    return replace(lane, signals=signals, initial_states=dict(zip("xvz", states, strict=True)))


def test_each_interval_has_the_bits_of_a_separate_simulation(program: OdeProgram) -> None:
    lanes = make_lanes()
    rng = np.random.default_rng(3)
    states = rng.standard_normal((11, INTERVALS, 3))
    order = rng.integers(0, len(lanes), 11)
    is_asked = rng.random((11, INTERVALS)) < 0.6
    simulation = IntervalSimulation(program, DT, lanes, "xvz", INTERVAL)
    found = simulation.simulate(order, states, is_asked)[:, 0]
    assert simulation.is_independent
    assert np.isnan(found[~is_asked]).all()
    for run, number in np.argwhere(is_asked):
        lane = take_interval(lanes[order[run]], number, states[run, number])
        (expected,) = simulate_lanes(program, DT, [lane])[0]
        assert np.array_equal(found[run, number, : expected.size], expected)
    fewer = IntervalSimulation(program, DT, lanes, "xvz", INTERVAL, every=3)
    assert np.array_equal(fewer.simulate(order, states, is_asked)[:, 0], found[..., ::3], equal_nan=True)


def test_divergence_is_that_of_one_interval(program: OdeProgram) -> None:
    states = np.zeros((1, INTERVALS, 3))
    states[0, 1] = 1e308
    simulation = IntervalSimulation(program, DT, make_lanes()[:1], "xvz", INTERVAL)
    with np.errstate(over="ignore", invalid="ignore"):
        found = simulation.simulate(np.array([0]), states, np.ones((1, INTERVALS), dtype=bool))[0, 0]
    assert np.isfinite(found).all(axis=1).tolist() == [True, False, True, True, True]
