"""Causes in a mass on a spring and a damper, which is driven by a force."""

from collections.abc import Callable

import numpy as np

from lab.diagnosis.injection.excitation import Signal, random_noise, random_sign
from lab.diagnosis.injection.unusual.cause import DrawResponse, Response, UnusualCause
from lab.diagnosis.injection.unusual.integration import (
    MACHINE_DT,
    MACHINE_SAMPLES,
    MACHINE_STEPS,
    PEAK_FORCE,
    draw_force,
    integrate,
)

#: Mass in kg, damping in N s/m and stiffness in N/m: 8 Hz, damping ratio 0.1.
MASS, DAMPING, STIFFNESS = 0.8, 8.0, 2000.0

#: Typical largest displacement in m.
REACH = 0.02

#: Speed in m/s above which dry friction is full, so that the equations have one solution.
_CREEP = 2e-3

_STEP = MACHINE_DT / MACHINE_STEPS
_DURATION = MACHINE_SAMPLES * MACHINE_DT
Rng = np.random.Generator

#: Force besides the input in newton: ``(time, displacement, speed) -> force``.
ExtraForce = Callable[[float, float, float], float]


def _move(force: ExtraForce, u: Signal) -> Signal:
    """Return displacement and speed at the steps, given the force besides the input."""

    def equation(time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        x, v = state
        return v, (u - DAMPING * v - STIFFNESS * x + force(time, x, v)) / MASS

    return integrate(equation, (0.0, 0.0), u, _STEP)


def _sample(signal: Signal) -> Signal:
    """Return the samples of a record of a signal at the steps."""
    return signal[::MACHINE_STEPS][:MACHINE_SAMPLES]


def _respond(u: Signal, x: Signal) -> Response:
    return Response(_sample(u)[:, None], _sample(x))


def respond_cleanly(record: Rng) -> Response:
    """Draw a record of the mass without a cause."""
    u = draw_force(record)
    return _respond(u, _move(_no_force, u)[:, 0])


def respond_exactly(record: Rng) -> Response:
    """Draw a record of the mass without a cause, whose force is linear between its samples."""
    u = draw_force(record)
    steps = np.arange(u.size)
    u = np.interp(steps, steps[::MACHINE_STEPS], u[::MACHINE_STEPS])
    return _respond(u, _move(_no_force, u)[:, 0])


def _no_force(_time: float, _x: float, _v: float) -> float:
    return 0.0


def _friction(v: float) -> float:
    """Return dry friction of one newton."""
    return -float(np.tanh(v / _CREEP))


def _under_force(make: Callable[[Rng], ExtraForce]) -> DrawResponse:
    """Return the draw of a mass with one more force, whose strength the plant's generator draws."""

    def draw(plant: Rng, record: Rng) -> Response:
        force, u = make(plant), draw_force(record)
        return _respond(u, _move(force, u)[:, 0])

    return draw


def _late_friction(plant: Rng) -> ExtraForce:
    strength, begin = plant.uniform(0.8, 2.0), plant.uniform(0.4, 0.6) * _DURATION
    return lambda t, _x, v: strength * _friction(v) if t >= begin else 0.0


def _early_friction(plant: Rng) -> ExtraForce:
    strength, end = plant.uniform(0.8, 2.0), plant.uniform(0.35, 0.55) * _DURATION
    return lambda t, _x, v: strength * _friction(v) if t < end else 0.0


def _late_stiffness(plant: Rng) -> ExtraForce:
    strength, begin = plant.uniform(0.2, 0.5) * STIFFNESS, plant.uniform(0.4, 0.6) * _DURATION
    return lambda t, x, _v: -strength * x * (x / REACH) ** 2 if t >= begin else 0.0


def _amplitude_damping(plant: Rng) -> ExtraForce:
    strength = plant.uniform(1.0, 3.0) * DAMPING
    return lambda _t, x, v: -strength * v * (x / REACH) ** 2


def _fading_damper(plant: Rng) -> ExtraForce:
    part, time = plant.uniform(0.5, 0.9), plant.uniform(0.3, 0.8) * _DURATION
    return lambda t, _x, v: part * DAMPING * v * (1.0 - np.exp(-t / time))


def _fifth_power(plant: Rng) -> ExtraForce:
    strength = plant.uniform(0.2, 0.6) * STIFFNESS
    return lambda _t, x, _v: -strength * x * (x / REACH) ** 4


def _pendulum(plant: Rng) -> ExtraForce:
    length = plant.uniform(0.8, 1.5) * REACH
    return lambda _t, x, _v: STIFFNESS * (x - length * np.sin(x / length))


def _dahl(plant: Rng, record: Rng) -> Response:
    limit, stiffness, u = plant.uniform(1.0, 3.0), plant.uniform(1000.0, 3000.0), draw_force(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        x, v, friction = state
        slope = stiffness * (v - friction / limit * abs(v))
        return v, (u - DAMPING * v - STIFFNESS * x - friction) / MASS, slope

    return _respond(u, integrate(equation, (0.0, 0.0, 0.0), u, _STEP)[:, 0])


def _swept_force(plant: Rng, record: Rng) -> Response:
    strength, fastest = plant.uniform(0.8, 2.0), plant.uniform(6.0, 15.0)
    phase, u = record.uniform(0.0, 2 * np.pi), draw_force(record)
    time = np.arange(u.size) * _STEP
    swept = strength * np.sin(2 * np.pi * (0.5 * time + (fastest - 0.5) / 2 * time**2 / _DURATION) + phase)
    return _respond(u, _move(_no_force, u + swept)[:, 0])


def _ignored_input(plant: Rng, record: Rng) -> Response:
    strength, u = random_sign(plant) * plant.uniform(0.2, 0.6), draw_force(record)
    other = random_noise(record, u.size, 1 / _STEP, 10.0, 1.0)
    other = PEAK_FORCE * other / np.max(np.abs(other))
    x = _move(_no_force, u + strength * other)[:, 0]
    return Response(np.column_stack([_sample(u), _sample(other)]), _sample(x))


def _quantised_force(plant: Rng, record: Rng) -> Response:
    step, u = plant.uniform(1.5, 4.0), draw_force(record)
    return _respond(u, _move(_no_force, step * np.round(u / step))[:, 0])


def _aliasing(plant: Rng, record: Rng) -> Response:
    size, excess = plant.uniform(0.05, 0.15) * REACH, plant.uniform(1.0, 12.0)
    phase, u = record.uniform(0.0, 2 * np.pi), draw_force(record)
    time = np.arange(u.size) * _STEP
    disturbance = size * np.sin(2 * np.pi * (1 / MACHINE_DT + excess) * time + phase)
    return _respond(u, _move(_no_force, u)[:, 0] + disturbance)


def _late_sensor(plant: Rng, record: Rng) -> Response:
    delay, u = plant.uniform(1.2, 4.8) * MACHINE_DT, draw_force(record)
    x, time = _move(_no_force, u)[:, 0], np.arange(u.size) * _STEP
    return _respond(u, np.interp(time - delay, time, x))


def _fast_clock(plant: Rng, record: Rng) -> Response:
    """Read the sensor at the times of a clock that is fast or slow by 0.3 %."""
    factor, u = 1.0 + 0.003 * random_sign(plant), draw_force(record)
    x, time = _move(_no_force, u)[:, 0], np.arange(u.size) * _STEP
    return _respond(u, np.interp(time * factor, time, x))


def _gear(plant: Rng, record: Rng) -> Response:
    """Drive the mass by a motor and a gear that has play and is elastic."""
    gap, u = plant.uniform(0.02, 0.06) * REACH, draw_force(record)
    motor_mass, motor_damping, stiffness, damping = 0.05, 2.0, 10_000.0, 20.0

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        x, v, motor, motor_speed = state
        twist = motor - x
        wound = twist - gap if twist > gap else twist + gap if twist < -gap else 0.0
        torque = stiffness * wound + damping * (motor_speed - v) if wound else 0.0
        load = (torque - DAMPING * v - STIFFNESS * x) / MASS
        return v, load, motor_speed, (u - torque - motor_damping * motor_speed) / motor_mass

    return _respond(u, integrate(equation, (0.0, 0.0, 0.0, 0.0), u, _STEP)[:, 0])


def _stick_slip(plant: Rng, record: Rng) -> Response:
    """Control the position of a mass with friction that falls from stiction to a constant."""
    sliding, excess, speed = plant.uniform(1.5, 3.0), plant.uniform(0.5, 1.5), 0.03
    gain, integral, rate = 1000.0, 4000.0, 8.0
    target = draw_force(record) / PEAK_FORCE * REACH
    target = np.cumsum(target) * _STEP * 8.0  # Slow, so that the mass sticks at its turns.

    def control(target: float, x: float, v: float, sum_: float) -> float:
        return gain * (target - x) + integral * sum_ - rate * v

    def equation(_time: float, state: tuple[float, ...], target: float) -> tuple[float, ...]:
        x, v, sum_ = state
        friction = (sliding + excess * np.exp(-((v / speed) ** 2))) * _friction(v)
        force = control(target, x, v, sum_) - DAMPING * v - STIFFNESS * x + friction
        return v, force / MASS, target - x

    x, v, sum_ = integrate(equation, (0.0, 0.0, 0.0), target, _STEP).T
    return _respond(gain * (target - x) + integral * sum_ - rate * v, x)


def _sensor_hysteresis(plant: Rng, record: Rng) -> Response:
    half, u = plant.uniform(0.03, 0.1) * REACH, draw_force(record)
    shown, reading = [], 0.0
    for x in _move(_no_force, u)[:, 0].tolist():
        reading = min(max(reading, x - half), x + half)
        shown.append(reading)
    return _respond(u, np.array(shown))


def _cause(
    name: str, summary: str, draw: DrawResponse, names: str, terms: str, family: str, family_terms: str = ""
) -> UnusualCause:
    return UnusualCause(
        *(name, summary, "second-order", draw, frozenset(names.split()), terms, frozenset(family.split())),
        family_terms,
        carries=name not in ("swept-force", "aliasing"),
    )


#: Causes in a machine. The equations of the simulation have the states x and v.
MACHINE_CAUSES = (
    _cause(
        "late-friction",
        "dry friction begins at 40 to 60 % of the record",
        _under_force(_late_friction),
        "",
        r"sign\(v\).* from t|tanh\(v/.*from t",
        "coulomb-friction damping-curve",
        r"sign\(v\)|tanh\(v/",
    ),
    _cause(
        "early-friction",
        "dry friction ends at 35 to 55 % of the record",
        _under_force(_early_friction),
        "",
        r"sign\(v\).* until t|tanh\(v/.*until t",
        "coulomb-friction damping-curve",
        r"sign\(v\)|tanh\(v/",
    ),
    _cause(
        "late-stiffness",
        "a cubic spring begins to act at 40 to 60 % of the record",
        _under_force(_late_stiffness),
        "",
        r"x\*\*3.* from t",
        "cubic-stiffness stiffness-curve",
        r"x\*\*[35]|abs\(x\)\*x",
    ),
    _cause(
        "amplitude-damping",
        "damping grows with the square of the displacement",
        _under_force(_amplitude_damping),
        "",
        r"x\*\*2\*v|v\*x\*\*2",
        "damping-curve quadratic-drag",
        r"(?=.*\bx\b)(?=.*\bv\b)|abs\(v\)\*v|v\*\*3",
    ),
    _cause(
        "fading-damper",
        "the damper loses 50 to 90 % of its damping",
        _under_force(_fading_damper),
        "",
        r"\((t\*v|v\*t|v\*exp\(-t/s\d\))\)",
        "damping-curve viscous",
        r"(?=.*\bt\b)(?=.*\bv\b)",
    ),
    _cause(
        "fifth-power",
        "the spring hardens by the fifth power of the displacement",
        _under_force(_fifth_power),
        "",
        r"x\*\*5",
        "cubic-stiffness stiffness-curve",
        r"x\*\*3|abs\(x\)\*x",
    ),
    _cause(
        "pendulum",
        "the restoring force is a sine of the displacement",
        _under_force(_pendulum),
        "cubic-stiffness",
        r"sin\(|x\*\*3",
        "stiffness-curve cogging",
        r"x\*\*[25]|abs\(x\)|tanh\(x",
    ),
    _cause(
        "dahl-friction",
        "friction with a state by Dahl",
        _dahl,
        "second-hysteresis",
        "",
        "memory damping-curve",
        r"sign\(v\)|tanh\(v/",
    ),
    _cause(
        "swept-force",
        "a force that is not measured sweeps through the resonance",
        _swept_force,
        "swept-disturbance",
        "",
        "disturbance",
    ),
    _cause(
        "ignored-input",
        "a second measured force acts, which the simulation ignores",
        _ignored_input,
        "second-input ignored-input",
        r"\bF2(_N)?\b",
        "cross-coupling",
    ),
    _cause(
        "quantised-force",
        "the actuator rounds the force to steps",
        _quantised_force,
        "quantisation quantised-input quantiser",
        r"round\(",
        "input-curve",
    ),
    _cause(
        "aliasing",
        "a disturbance above the sampling rate appears at the output at a low frequency",
        _aliasing,
        "periodic-disturbance",
        "",
        "disturbance",
    ),
    _cause("late-sensor", "the sensor is behind a delay", _late_sensor, "delay sensor-delay", "", "timing"),
    _cause(
        "fast-clock",
        "the clock of the sensor is fast or slow by 0.3 %",
        _fast_clock,
        "clock-skew",
        "",
        "timing",
    ),
    _cause(
        "elastic-gear",
        "a gear between motor and mass has play and is elastic",
        _gear,
        "backlash",
        "",
        "memory dead-zone resonance",
    ),
    _cause(
        "stick-slip",
        "the mass sticks and slips in a position control",
        _stick_slip,
        "coulomb-friction",
        r"sign\(v\)|tanh\(v/",
        "memory damping-curve",
    ),
    _cause(
        "sensor-hysteresis",
        "the sensor has play",
        _sensor_hysteresis,
        "sensor-hysteresis output-backlash output-memory",
        "",
        "memory",
    ),
)
