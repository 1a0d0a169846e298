"""Multiple shooting: fitted states, and derivatives of outputs with fitted states."""

import math
from dataclasses import replace

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.ode import native_code
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import OdeProgram, generate_program
from islands.simulators.ode.sampled_signal import SampledSignal, make_time
from islands.simulators.ode.shooting import IntervalSimulation
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system_document import make_system
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import made, recorded, simulate_oscillator, wave

EFFECTS = {
    "without effects": [],
    "a force": ["cubic-stiffness"],
    "a state that is kept": ["second-hysteresis"],
}

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


@pytest.fixture(params=EFFECTS)
def axis(request: pytest.FixtureRequest) -> tuple[ExtendedSimulator, np.ndarray]:
    """Return an axis with effects, and values at which the effects do not vanish."""
    case = made()["rigid-axis"]
    effects = [CATALOGUE[name] for name in EFFECTS[request.param]]
    simulation = ExtendedSimulator(
        case.simulator, effects, make_context(case.record, case.simulator, case.record.samples)
    )
    values = simulation.nominal
    for effect in effects:
        starts = effect.starting_points(simulation.context, case.record.y)
        values[simulation.get_slice(effect)] = starts[-1]
    return simulation, values


def test_change_of_fitted_states_is_their_first_order(axis: tuple[ExtendedSimulator, np.ndarray]) -> None:
    """The output near another one is that of fitted states, without another fit."""
    simulation, values = axis
    points = np.vstack([values + 1e-2 * np.diag(simulation.scales), values])
    near = np.full(len(points), len(points) - 1)
    *found, base = simulation.simulate_batch(points, near)
    assert np.array_equal(base, simulation.simulate_batch(values[None])[0])
    for parameter, point, output in zip(simulation.parameters, points, found, strict=False):
        expected, change = simulation.simulate_batch(point[None])[0] - base, output - base
        assert np.std(change - expected) < 0.05 * np.std(expected) + 1e-11, parameter.name


def test_shooting_fits_the_states_of_every_interval() -> None:
    """The equations are right, so that only the fitted positions and rates determine the output."""
    case = made()["rigid-axis"]
    position = simulate_oscillator(wave(), 2.0, 6.0, 0.0)
    noisy = position + 1e-3 * np.random.default_rng(2).standard_normal(position.size)
    record = recorded(wave(), noisy, units=("N", "m"))
    spec = PhysicalSpec(kind="rigid-axis", parameters={"m": 2.0, "c": 6.0, "F": 0.0, "vs": 1.0})
    simulator = make_simulator(spec, record)
    assert [each.name for each in simulator.parameters] == ["m", "c", "F", "vs"]
    assert simulator.built_in_effects == made()["rigid-axis"].simulator.built_in_effects
    assert isinstance(case.simulator, OdeSimulator)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    found = simulation.simulate(simulation.nominal)
    # Two states in 50 samples have a fifth of the noise; the smoothed guesses alone have more.
    assert np.std(found - position) < 0.25e-3
    jumps = np.abs(np.diff(found) - np.diff(position))
    assert set(np.flatnonzero(jumps > 1e-4) % 50) <= {49}


def make_sticking_axis(seed: int, samples: int = 1500) -> tuple[Dataset, float]:
    """Return a record of an axis that sticks at times, with 2 % of noise, and the noise."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(samples)
    phases = np.outer(time, rng.uniform(1.3, 12.6, 12)) + rng.uniform(0, 6.3, 12)
    u = 10.0 * np.sin(phases).sum(axis=1) * np.minimum(1.0, time)
    x, v, h, position = 0.0, 0.0, 5e-4, []
    for k, force in enumerate(np.interp(h * np.arange(20 * samples), time, u).tolist()):
        if k % 20 == 0:
            position.append(x)
        v += h * (force - 6.0 * v - 4.0 * math.tanh(v / 0.01)) / 2.0
        x += h * v
    sigma = 0.02 * float(np.std(position))
    return recorded(u, np.array(position) + sigma * rng.standard_normal(samples), units=("N", "m")), sigma


@pytest.mark.parametrize("seed", range(3))
def test_shots_of_an_axis_that_sticks_have_the_error_of_the_noise(seed: int) -> None:
    """A full Gauss-Newton step increases the error where the axis sticks, and shorter steps decrease it."""
    record, sigma = make_sticking_axis(seed)
    truth = {"m": 2.0, "c": 6.0, "F": 4.0, "vs": 0.01}
    simulator = make_simulator(PhysicalSpec(kind="rigid-axis", parameters=truth), record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    assert np.std(record.y - simulation.simulate(simulation.nominal)) < 1.02 * sigma


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
