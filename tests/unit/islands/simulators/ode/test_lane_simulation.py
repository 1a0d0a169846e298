"""Simulation of equations: compared with a plain integration, with compiled kernels, and lane by lane."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.expressions.evaluation import evaluate
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.sampled_signal import SampledSignal, interpolate_linearly, make_time
from islands.simulators.ode.system import OdeSystem, sort_variables
from islands.simulators.ode.system_document import make_system

Array = NDArray[np.float64]

DT = 0.01
SAMPLES = 200
TIME = DT * np.arange(SAMPLES)
FORCE = 3.0 * np.sin(7.0 * TIME) + 2.0 * np.cos(3.1 * TIME)

#: Every function and operator, all kinds of names, a state that defines another one in either order.
EVERYTHING = {
    "name": "everything",
    "input": "F",
    "channels": ["T"],
    "equations": """
        dy/dt = -y + 0.2*x + slope - rest
        dx/dt = y
        dw/dt = x
        slope = 0.1*rate(F) + delay(T, tau) + delay(F, 0.025)
        rest = where(x > 0.1, sqrt(abs(x)), -x) + (y <= 0)*max(x, y, -0.3) + min(F, x**3) + (x < y)
        dz/dt = a*tanh(x) - exp(-abs(y)) + log(1 + x**2) + sin(t)*cos(F) + tan(0.1*x) - atan(y)/b + sign(x)
        dp/dt = -p**5 + abs(x)**0.5 + k/(1 + z**2) - -p
        k = 2*a*b
    """,
    "output": "x + 0.1*z + w*p + F",
    "parameters": {"a": 0.4, "b": 2.0, "tau": 0.033},
}


def integrate_plainly(system: OdeSystem, lane: LaneInput, steps: int) -> Array:
    """Integrate by RK4 with `evaluate`, one sample after the other; only linear signals."""
    order, variables = sort_variables(system), dict(system.variables)
    states = dict(lane.initial_states)

    def compute(at: Mapping[str, float], moment: float, step: int) -> dict[str, Any]:
        values: dict[str, Any] = {**lane.parameters, **at, "t": moment * DT}
        place = np.arange(SAMPLES)
        values["rate(F)"] = np.diff(lane.signals["F"].start)[step] / DT
        for name in system.signals:
            signal = lane.signals[name].start
            values[name] = np.interp(moment, place, signal)
        for name, signal, seconds in (
            ("delay(T, tau)", "T", lane.parameters["tau"]),
            ("delay(F, 0.025)", "F", 0.025),
        ):
            values[name] = np.interp(moment - seconds / DT, place, lane.signals[signal].start)
        for name in order:
            values[name] = evaluate(variables[name], values)
        return values

    def differentiate(at: Mapping[str, float], moment: float, step: int) -> dict[str, float]:
        values = compute(at, moment, step)
        return {name: float(evaluate(right, values)) for name, right in system.derivatives}

    found = []
    for k in range(steps):
        found.append(float(evaluate(system.output, compute(states, k, k))))
        total, slope = dict.fromkeys(states, 0.0), dict.fromkeys(states, 0.0)
        for weight, ahead in ((1, 0.0), (2, 0.5), (2, 0.5), (1, 1.0)):
            at = {name: states[name] + DT * ahead * slope[name] for name in states}
            slope = differentiate(at, k + ahead, k)
            total = {name: total[name] + weight * slope[name] for name in states}
        states = {name: states[name] + DT / 6 * total[name] for name in states}
    return np.array(found)


def everything(**changes: float) -> LaneInput:
    signals = {"F": interpolate_linearly(FORCE), "T": interpolate_linearly(np.cos(TIME) - 0.5)}
    parameters = {"a": 0.4, "b": 2.0, "tau": 0.033, **changes}
    initial = {"y": 0.2, "x": 0.1, "w": 0.0, "z": -0.3, "p": 0.5}
    return LaneInput(parameters, initial, {**signals, **make_time(0.0, SAMPLES, DT)})


def test_every_function_has_the_value_of_the_reference() -> None:
    system = make_system(EVERYTHING)
    lane = everything()
    found = simulate_lanes(generate_program(system), DT, [lane])[0, 0]
    assert found[:60] == pytest.approx(integrate_plainly(system, lane, 60), abs=1e-11)


def test_a_lane_does_not_depend_on_the_others() -> None:
    """Also not on one that diverges, nor on one with its own signals, nor on the number of lanes."""
    program = generate_program(make_system(EVERYTHING))
    lanes = [everything(a=0.4 + 0.01 * i, tau=0.033 + 0.001 * i) for i in range(19)]
    lanes[3] = replace(lanes[3], initial_states={**lanes[3].initial_states, "p": 1e200})
    lanes[5] = replace(lanes[5], signals={**lanes[5].signals, "F": interpolate_linearly(2 * FORCE)})
    together = simulate_lanes(program, DT, lanes)
    alone = np.concatenate([simulate_lanes(program, DT, [each]) for each in reversed(lanes)])[::-1]
    assert np.array_equal(together, alone, equal_nan=True)
    assert np.isnan(together).all(axis=(1, 2)).tolist() == [i == 3 for i in range(19)]
    assert np.array_equal(together[:, :, ::3], simulate_lanes(program, DT, lanes, every=3), equal_nan=True)


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    system = make_system(
        {"name": "s", "input": "F", "equations": "dx/dt = -x**3 + F*x", "output": "x", "states": {"x": {}}}
    )
    program, errors = generate_program(system), []
    for parts in (1, 2, 64):
        time = TIME[-1] / (60 * parts) * np.arange(60 * parts + 1)
        step = time[1]
        signal = SampledSignal.join(*(np.sin(2 * (time + ahead * step)) for ahead in (0.0, 0.5, 1.0)))
        errors.append(simulate_lanes(program, step, [LaneInput({}, {"x": 1.5}, {"F": signal})])[0, 0, -1])
    ratio = (errors[0] - errors[2]) / (errors[1] - errors[2])
    assert ratio == pytest.approx(16.0, rel=0.25)
