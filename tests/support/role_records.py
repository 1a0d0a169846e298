"""Records of many kinds in which the inputs and the outputs are known, with columns in random order.

Each kind has two systems, so that a choice that is calibrated on one can be tested on the other. The names of
the columns say nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from islands.records.inspection.column_roles import ColumnChoice
from support.known_records import Signal, delay, hysteresis, lag

Random = np.random.Generator
Columns = dict[str, Signal]


@dataclass(frozen=True)
class Roles:
    """An output that may be chosen, the inputs that have to be chosen with it, and those that may be."""

    output: str
    inputs: frozenset[str]
    others: frozenset[str] = frozenset()

    def match(self, choice: ColumnChoice) -> bool:
        chosen = set(choice.inputs)
        return choice.output == self.output and self.inputs <= chosen <= self.inputs | self.others


@dataclass(frozen=True)
class RoleRecord:
    """A record and all right choices; none if no column responds to another one."""

    kind: str
    columns: Mapping[str, Signal]
    answers: tuple[Roles, ...]

    def is_right(self, choice: ColumnChoice) -> bool:
        if not self.answers:
            return choice.output == ""
        return any(roles.match(choice) for roles in self.answers)


def roles(output: str, inputs: str, others: str = "") -> Roles:
    return Roles(output, frozenset(inputs.split()), frozenset(others.split()))


# Inputs


def step_input(rng: Random, samples: int, held: float) -> Signal:
    lengths = np.maximum(1, rng.exponential(held, 2 + int(4 * samples / held))).astype(int)
    return np.repeat(rng.uniform(-1.0, 1.0, len(lengths)), lengths)[:samples]


def binary(rng: Random, samples: int, held: int) -> Signal:
    return np.repeat(rng.integers(0, 2, samples // held + 1), held)[:samples].astype(float)


def sines(rng: Random, samples: int, period: int, highest: float) -> Signal:
    lines = np.arange(1, max(3, int(highest * period)))
    phases = rng.uniform(0, 2 * np.pi, len(lines))
    k = np.arange(period)[:, None]
    one = np.cos(2 * np.pi * k * lines / period + phases).sum(axis=1)
    return np.resize(one / one.std(), samples)


def coloured(rng: Random, samples: int, constant: float) -> Signal:
    u = lag(rng.standard_normal(samples), constant)
    return u / u.std()


def walk(rng: Random, samples: int) -> Signal:
    return np.cumsum(rng.standard_normal(samples)) / np.sqrt(samples)


def add_noise(rng: Random, y: Signal, part: float) -> Signal:
    return y + part * y.std() * rng.standard_normal(len(y))


def round_to(x: Signal, levels: float) -> Signal:
    step = np.ptp(x) / levels
    return np.round(x / step) * step


def resonance(u: Signal, period: float, damping: float) -> Signal:
    radius = np.exp(-2 * np.pi * damping / period)
    a1, a2 = 2 * radius * np.cos(2 * np.pi / period), -(radius**2)
    return lfilter([0.0, 1.0 - a1 - a2], [1.0, -a1, -a2], u)


def simulate(rule: Callable[[float, int], float], samples: int, start: float = 0.0) -> Signal:
    """Return the states x of x(k+1) = rule(x(k), k)."""
    x = np.empty(samples)
    x[0] = start
    for k in range(samples - 1):
        x[k + 1] = rule(x[k], k)
    return x


def draw_size(rng: Random, least: int = 800, most: int = 4000) -> int:
    return int(rng.integers(least, most))


# Kinds: each takes the generator and whether the system is that of the test.


def make_steps(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = step_input(rng, n, rng.uniform(5, 60))
    y = resonance(u, rng.uniform(10, 40), rng.uniform(0.1, 0.5)) if test else lag(u, rng.uniform(2, 30))
    y = delay(y, int(rng.integers(0, 10)))
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.005, 0.1))}, (roles("y", "u"),)


def make_binary(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = binary(rng, n, int(rng.integers(1, 12)))
    y = lag(lag(u, rng.uniform(2, 12)), 4.0) if test else resonance(u, rng.uniform(8, 30), 0.2)
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.01, 0.2))}, (roles("y", "u"),)


def make_multisine(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000)
    u = sines(rng, n, int(rng.integers(200, 900)), rng.uniform(0.05, 0.3))
    x = resonance(u, rng.uniform(15, 60), 0.1) if test else lag(u, rng.uniform(2, 20))
    y = x + 0.2 * x**3 if test else x
    u = add_noise(rng, u, 0.002) if rng.random() < 0.5 else u
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.002, 0.05))}, (roles("y", "u"),)


def make_single_step(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 200, 1500)
    u = np.where(np.arange(n) < rng.uniform(0.1, 0.5) * n, 0.0, 60.0)
    y = lag(lag(u, n / 20), n / 60) if test else lag(u, rng.uniform(5, 0.1 * n))
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.002, 0.03))}, (roles("y", "u"),)


def make_noise(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = coloured(rng, n, rng.uniform(1, 8)) if test else rng.standard_normal(n)
    y = lag(u, rng.uniform(2, 20)) - (0.5 * lag(u, 3.0) if test else 0.0)
    u = add_noise(rng, u, rng.uniform(0, 0.02))
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.01, 0.1))}, (roles("y", "u"),)


def make_noisy_response(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u = step_input(rng, n, 30) if test else coloured(rng, n, 5.0)
    y = lag(u, rng.uniform(4, 20))
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.3, 0.8))}, (roles("y", "u"),)


def make_hysteresis(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    k = np.arange(n)
    if test:
        turns = rng.uniform(-1, 1, n // 60 + 2)
        u = np.interp(k, np.arange(len(turns)) * 60.0, turns)
    else:
        u = np.sin(2 * np.pi * k / rng.uniform(80, 300)) * (0.3 + 0.7 * np.cos(np.pi * k / n) ** 2)
    y = hysteresis(u)
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.002, 0.03))}, (roles("y", "u"),)


def make_control_loop(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    r = step_input(rng, n, 80)
    pole, gain, integral = rng.uniform(0.85, 0.97), rng.uniform(1.0, 4.0), rng.uniform(0.02, 0.15)
    x, total, u, y = 0.0, 0.0, np.empty(n), np.empty(n)
    inside, disturbance = 0.0, 0.05 * coloured(rng, n, 20.0)
    for k in range(n):
        y[k] = x + disturbance[k] + 0.01 * rng.standard_normal()
        total += integral * (r[k] - y[k])
        u[k] = gain * (r[k] - y[k]) + total
        if test:
            u[k] = min(max(u[k], -1.5), 1.5)
            inside += 0.3 * (u[k] - inside)
        x = pole * x + (1 - pole) * (inside if test else u[k])
    return {"r": r, "u": u, "y": y}, (roles("y", "u"),)


def make_thermostat(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    r = 20.0 + 2.0 * step_input(rng, n, 400)
    rate, on, x, inside = rng.uniform(0.005, 0.03), 0.0, 18.0, 18.0
    u, y = np.empty(n), np.empty(n)
    for k in range(n):
        y[k] = inside + 0.03 * rng.standard_normal()
        on = 1.0 if y[k] < r[k] - 0.3 else 0.0 if y[k] > r[k] + 0.3 else on
        u[k] = on
        x += rate * (10.0 + 25.0 * on - x)
        inside += 0.3 * (x - inside)
    y = np.round(y, 1) if test else y
    columns = {"u": 60.0 * u, "y": y}
    return columns | ({"r": r} if test else {}), (roles("y", "u"),)


def make_slow_heating(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000, 6000)
    u = np.maximum(0.0, step_input(rng, n, 300)) * 100
    first = lag(u, rng.uniform(100, 400))
    second = lag(first, rng.uniform(50, 200))
    one, two = 20 + first, 20 + second
    one, two = (np.round(t + 0.1 * rng.standard_normal(n), 1) for t in (one, two))
    if test:
        return {"u": u, "one": one, "two": two}, (roles("one", "u"), roles("two", "u"))
    return {"u": u, "two": two}, (roles("two", "u"),)


def make_two_inputs(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u, v = step_input(rng, n, 20), binary(rng, n, 15) if test else coloured(rng, n, 4.0)
    y = lag(u, rng.uniform(3, 15)) + rng.uniform(0.4, 1.0) * lag(v, rng.uniform(3, 15))
    return {"u": u, "v": v, "y": add_noise(rng, y, rng.uniform(0.01, 0.1))}, (roles("y", "u v"),)


def make_three_inputs(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000)
    u, v, w = (step_input(rng, n, held) for held in (15, 40, 25))
    if test:
        y = resonance(u, 20, 0.3) + lag(delay(v, 5), 8.0) + 0.5 * lag(w, 5.0) * u
    else:
        y = lag(u, 10.0) + lag(v, 5.0) - 0.7 * lag(w, 20.0)
    return {"u": u, "v": v, "w": w, "y": add_noise(rng, y, 0.03)}, (roles("y", "u v w"),)


def make_unrelated_column(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = step_input(rng, n, 25)
    y = add_noise(rng, lag(u, rng.uniform(3, 20)), 0.05)
    w = step_input(rng, n, 40) if test else coloured(rng, n, 30.0)
    return {"u": u, "w": w, "y": y}, (roles("y", "u"),)


def make_no_relation(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    kinds = [
        lambda: rng.standard_normal(n),
        lambda: step_input(rng, n, 30),
        lambda: coloured(rng, n, 20.0),
        lambda: walk(rng, n),
        lambda: np.round(20 + 3 * walk(rng, n), 1),
        lambda: binary(rng, n, 20),
    ]
    chosen = rng.choice(len(kinds), 3 if test else 2, replace=False)
    return {f"x{place}": kinds[place]() for place in chosen}, ()


def make_clocks(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = step_input(rng, n, 25)
    y = add_noise(rng, resonance(u, 25, 0.3) if test else lag(u, 12.0), 0.04)
    k = np.arange(float(n))
    columns = {"u": u, "y": y, "count": k, "second": k % 60}
    if test:
        columns |= {"minute": k // 60 % 60, "part": k // 300, "beat": k % 2}
    return columns, (roles("y", "u"),)


def make_derivative(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u = binary(rng, n, 20) if test else step_input(rng, n, 30)
    y = add_noise(rng, resonance(u, rng.uniform(20, 60), 0.2), 0.005)
    d = np.gradient(y) if test else np.diff(y, prepend=y[0])
    return {"u": u, "y": y, "d": d}, (roles("y", "u"), roles("d", "u"))


def make_static_map(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 600, 2000)
    u = step_input(rng, n, 6) if test else coloured(rng, n, 3.0)
    x = rng.uniform(0, 1, n) if test else coloured(rng, n, 5.0)
    y = 2 * u**2 + 0.5 * u * x if test else np.tanh(2 * u) + 0.5 * x
    y = y + 0.02 * y.std() * rng.standard_normal(n)
    return {"u": u, "x": x, "y": y}, (roles("y", "u x"),)


def make_sine(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u = np.sin(2 * np.pi * np.arange(n) / rng.uniform(60, 300))
    y = hysteresis(u) if test else lag(u, rng.uniform(5, 40))
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.002, 0.03))}, (roles("y", "u"),)


def make_temperatures(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 3000, 6000)
    k = np.arange(n)
    outside = 8 + 6 * np.sin(2 * np.pi * k / 288) + 2 * coloured(rng, n, 60.0)
    heat = 40.0 * binary(rng, n, 50) if test else np.maximum(0, step_input(rng, n, 60)) * 30
    room = lag(outside + heat, rng.uniform(60, 150))
    room[:200] += 10 * np.exp(-np.arange(200) / 60)
    columns = {
        "outside": np.round(outside + 0.03 * rng.standard_normal(n), 1 if test else 2),
        "heat": heat,
        "room": np.round(room + 0.05 * rng.standard_normal(n), 1 if test else 2),
    }
    return columns, (roles("room", "heat outside"),)


def make_block(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u = 1.5 * step_input(rng, n, 20) if test else coloured(rng, n, 4.0)
    y = np.tanh(1.5 * lag(u, 8.0)) if test else lag(np.clip(u, -0.7, 1.0), 6.0)
    return {"u": u, "y": add_noise(rng, y, rng.uniform(0.01, 0.05))}, (roles("y", "u"),)


def make_tank(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    pump, valve = 1 + 0.8 * step_input(rng, n, 60), 1 + 0.5 * step_input(rng, n, 80)
    if test:
        h = simulate(lambda x, k: max(x + 0.05 * (pump[k] - valve[k] * np.sqrt(max(x, 0.0))), 0.0), n, 1.0)
        columns, answer = {"pump": pump, "valve": valve}, roles("h", "pump valve")
    else:
        h = simulate(lambda x, k: max(x + 0.05 * (pump[k] - np.sqrt(max(x, 0.0))), 0.0), n, 1.0)
        columns, answer = {"pump": pump}, roles("h", "pump")
    return columns | {"h": add_noise(rng, h, 0.02)}, (answer,)


def make_battery(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    current = np.where(step_input(rng, n, 60) > 0.2, 1.0, 0.0) * step_input(rng, n, 200)
    charge = np.cumsum(current) / 3600
    voltage = 3.7 - 0.8 * charge - 0.05 * current - 0.03 * lag(current, 30.0)
    if not test:
        return {"i": current, "v": voltage + 5e-4 * rng.standard_normal(n)}, (roles("v", "i"),)
    case = 25 + 3 * lag(current**2, 200.0) + 0.05 * rng.standard_normal(n)
    measured = np.round(current + 2e-3 * rng.standard_normal(n), 3)
    columns = {"i": measured, "v": np.round(voltage + 5e-4 * rng.standard_normal(n), 3), "t": case}
    return columns, (roles("v", "i"), roles("t", "i"))


def make_motor(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1500)
    u = 12 * (binary(rng, n, 25) if test else step_input(rng, n, 30))
    speed = simulate(lambda x, k: x + 0.08 * (u[k] - x) - 0.02 * np.tanh(20 * x), n)
    current = lag(u - speed, 1.5)
    columns = {"u": u, "speed": 25 * add_noise(rng, speed, 0.01), "current": add_noise(rng, current, 0.03)}
    if test:
        columns["angle"] = np.cumsum(speed) * 0.01
    answers = tuple(roles(name, "u") for name in columns if name != "u")
    return columns, answers


def make_long_dead_time(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2500)
    u = step_input(rng, n, 50) if test else coloured(rng, n, 10.0)
    y = delay(lag(u, rng.uniform(8, 30)), int(rng.integers(30, 90)))
    return {"u": u, "y": add_noise(rng, y, 0.03)}, (roles("y", "u"),)


def make_measured_command(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = step_input(rng, n, 30)
    felt = lag(u, 1.5) if test else u
    columns = {"u": u, "felt": add_noise(rng, felt, 0.01), "y": add_noise(rng, lag(felt, 15.0), 0.02)}
    answers = (roles("y", "u", "felt"), roles("y", "felt", "u"))
    return columns, (*answers, roles("felt", "u"))


def make_two_pairs(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 1200)
    columns, answers = {}, []
    for place in (1, 2):
        u = step_input(rng, n, 25) if test else sines(rng, n, n, 0.05)
        y = lag(lag(u, 10.0), rng.uniform(4, 12))
        columns |= {f"u{place}": u, f"y{place}": add_noise(rng, y, 0.03)}
        answers.append(roles(f"y{place}", f"u{place}"))
    return columns, tuple(answers)


def make_vibration(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000)
    k = np.arange(n)
    force = np.sin(2 * np.pi * k * (0.005 + 0.1 * k / n)) if test else coloured(rng, n, 1.5)
    place = resonance(force, rng.uniform(15, 40), 0.05)
    response = np.gradient(np.gradient(place)) if test else place
    return {
        "force": add_noise(rng, force, 0.01),
        "y": add_noise(rng, response, rng.uniform(0.005, 0.05)),
    }, (roles("y", "force"),)


def make_coarse_sensor(rng: Random, test: bool) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng)
    u = round_to(step_input(rng, n, 20), 8) if test else coloured(rng, n, 10.0)
    y = lag(u, rng.uniform(5, 40))
    return {"u": u, "y": round_to(add_noise(rng, y, 0.003), rng.uniform(15, 60))}, (roles("y", "u"),)


#: Kinds of records, by name.
KINDS: Mapping[str, Callable[[Random, bool], tuple[Columns, tuple[Roles, ...]]]] = {
    "steps": make_steps,
    "binary": make_binary,
    "multisine": make_multisine,
    "single step": make_single_step,
    "noise": make_noise,
    "noisy response": make_noisy_response,
    "hysteresis": make_hysteresis,
    "control loop": make_control_loop,
    "thermostat": make_thermostat,
    "slow heating": make_slow_heating,
    "two inputs": make_two_inputs,
    "three inputs": make_three_inputs,
    "unrelated column": make_unrelated_column,
    "no relation": make_no_relation,
    "clocks": make_clocks,
    "derivative": make_derivative,
    "static map": make_static_map,
    "sine": make_sine,
    "temperatures": make_temperatures,
    "block structure": make_block,
    "tank": make_tank,
    "battery": make_battery,
    "motor": make_motor,
    "long dead time": make_long_dead_time,
    "measured command": make_measured_command,
    "two pairs": make_two_pairs,
    "vibration": make_vibration,
    "coarse sensor": make_coarse_sensor,
}


# Files of loggers with many columns, which the weights do not know.


def log_heater(rng: Random) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2500, 5000)
    duty = 100 * np.maximum(0, step_input(rng, n, 200))
    ambient = 20 + lag(coloured(rng, n, 80.0), 40.0)
    inside = ambient + 0.4 * lag(duty, rng.uniform(80, 250))
    case = ambient + 0.3 * lag(inside - ambient, 60.0)
    current = 0.05 * duty * (1 + 0.01 * rng.standard_normal(n))
    columns = {
        "tick": np.arange(float(n)),
        "duty": np.round(duty, 1),
        "current": np.round(current, 3),
        "ambient": np.round(ambient + 0.05 * rng.standard_normal(n), 2),
        "inside": np.round(inside + 0.05 * rng.standard_normal(n), 2),
        "case": np.round(case + 0.05 * rng.standard_normal(n), 2),
        "supply": np.round(24 - 0.1 * current + 0.01 * rng.standard_normal(n), 2),
        "humidity": np.round(50 - 5 * coloured(rng, n, 200.0), 1),
        "status": np.zeros(n),
    }
    others = "ambient current duty"
    answers = [roles(name, "duty", others) for name in ("inside", "case", "current")]
    supply = [roles("supply", name, others) for name in ("duty", "current")]
    return columns, (*answers, *supply, roles("inside", "current", others))


def log_drive(rng: Random) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000, 4000)
    wanted = step_input(rng, n, 150) * 100
    load = 3 * np.maximum(0, step_input(rng, n, 250))
    speed, torque, x, total = np.empty(n), np.empty(n), 0.0, 0.0
    for k in range(n):
        speed[k] = np.round(x + 0.3 * rng.standard_normal(), 1)
        total += 0.02 * (wanted[k] - speed[k])
        torque[k] = np.clip(0.5 * (wanted[k] - speed[k]) + total, -20, 20)
        x += 0.1 * (torque[k] - load[k]) - 0.02 * x
    columns = {
        "wanted": wanted,
        "torque": np.round(torque, 3),
        "speed": speed,
        "position": np.cumsum(speed) * 0.01,
        "winding": np.round(25 + lag(0.2 * torque**2, 300.0) + 0.05 * rng.standard_normal(n), 1),
        "bus": np.round(325 - 0.2 * np.abs(torque) + 0.3 * rng.standard_normal(n), 1),
        "beat": np.arange(n) % 2.0,
    }
    return columns, tuple(roles(name, "torque") for name in ("speed", "winding", "bus", "position"))


def log_tanks(rng: Random) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 2000, 4000)
    pump, valve = 1 + 0.7 * step_input(rng, n, 100), 0.5 + 0.5 * binary(rng, n, 120)
    flow = lag(pump, 3.0)
    upper = simulate(lambda x, k: max(x + 0.04 * (flow[k] - np.sqrt(max(x, 0.0))), 0.0), n, 1.0)
    lower = simulate(
        lambda x, k: max(x + 0.04 * (np.sqrt(max(upper[k], 0.0)) - valve[k] * np.sqrt(max(x, 0.0))), 0.0),
        n,
        1.0,
    )
    columns = {
        "pump": pump,
        "valve": valve,
        "flow": add_noise(rng, flow, 0.03),
        "upper": add_noise(rng, upper, 0.01),
        "lower": add_noise(rng, lower, 0.01),
        "minute": np.arange(n) // 60 % 60.0,
    }
    upper_inputs = (roles("upper", "pump", "flow"), roles("upper", "flow", "pump"))
    lower_inputs = tuple(roles("lower", f"{name} valve", "pump flow") for name in ("pump", "flow"))
    return columns, (*upper_inputs, *lower_inputs, roles("flow", "pump"))


def log_building(rng: Random) -> tuple[Columns, tuple[Roles, ...]]:
    n = draw_size(rng, 4000, 6000)
    day = np.arange(n) / 288
    outside = 6 - 5 * np.cos(2 * np.pi * day) + 2 * coloured(rng, n, 150.0)
    sun = np.maximum(0.0, -np.cos(2 * np.pi * day)) * np.clip(1 + 0.5 * coloured(rng, n, 30.0), 0, 2) * 400
    wanted = np.where((day % 1 > 0.25) & (day % 1 < 0.9), 21.0, 17.0)
    room, valve, x = np.empty(n), np.empty(n), 18.0
    for k in range(n):
        room[k] = np.round(x + 0.03 * rng.standard_normal(), 2)
        valve[k] = np.round(np.clip(40 * (wanted[k] - room[k]) + 30, 0, 100))
        x += 0.008 * (outside[k] + 0.25 * valve[k] + 0.01 * sun[k] - x)
    columns = {
        "outside": np.round(outside + 0.05 * rng.standard_normal(n), 1),
        "sun": np.round(sun),
        "wanted": wanted,
        "valve": valve,
        "room": room,
        "carbon": np.round(600 + 150 * coloured(rng, n, 100.0)),
    }
    return columns, (roles("room", "valve", "outside sun"),)


#: Files of loggers, by name.
LOGGERS: Mapping[str, Callable[[Random], tuple[Columns, tuple[Roles, ...]]]] = {
    "heater": log_heater,
    "drive": log_drive,
    "tanks": log_tanks,
    "building": log_building,
}


def rename(kind: str, columns: Mapping[str, Signal], answers: tuple[Roles, ...], rng: Random) -> RoleRecord:
    """Return a record with columns in random order under names that say nothing."""
    names = list(columns)
    order = rng.permutation(len(names))
    new = {names[old]: f"channel_{place}" for place, old in enumerate(order)}
    return RoleRecord(
        kind,
        {new[names[old]]: columns[names[old]] for old in order},
        tuple(
            Roles(
                new[each.output],
                frozenset(new[name] for name in each.inputs),
                frozenset(new[name] for name in each.others),
            )
            for each in answers
        ),
    )


def make_record(kind: str, seed: int, test: bool) -> RoleRecord:
    rng = np.random.default_rng([seed, int(test), *map(ord, kind)])
    columns, answers = KINDS[kind](rng, test)
    return rename(kind, columns, answers, rng)


def make_records(count: int, test: bool, first: int = 0) -> list[RoleRecord]:
    return [make_record(kind, seed, test) for kind in KINDS for seed in range(first, first + count)]


def make_logs(count: int, first: int = 0) -> list[RoleRecord]:
    found = []
    for kind, make in LOGGERS.items():
        for seed in range(first, first + count):
            rng = np.random.default_rng([seed, *map(ord, kind)])
            found.append(rename(kind, *make(rng), rng))
    return found
