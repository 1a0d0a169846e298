"""Causes in processes of first and second order, whose input is held between samples."""

from collections.abc import Callable

import numpy as np

from lab.diagnosis.injection.excitation import Signal, random_noise, random_sign
from lab.diagnosis.injection.unusual.cause import DrawResponse, Response, UnusualCause
from lab.diagnosis.injection.unusual.integration import (
    PROCESS_DT,
    PROCESS_SAMPLES,
    PROCESS_STEPS,
    RightHandSide,
    draw_levels,
    hold,
    integrate,
)

#: Time constant in seconds and gain of a process of first order.
TIME, GAIN = 2.0, 1.5

#: Time constants in seconds of a process of second order; its gain is the same.
SLOW, FAST = 1.5, 0.5

_STEP = PROCESS_DT / PROCESS_STEPS
_DURATION = PROCESS_SAMPLES * PROCESS_DT
Rng = np.random.Generator


def _first_order(drive: Signal) -> Signal:
    """Return the output at the steps of a process of first order, given its held input at the steps."""

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        return ((GAIN * u - state[0]) / TIME,)

    return _integrate(equation, 1, drive)


def _second_order(drive: Signal) -> Signal:
    """Return the output at the steps of a process of second order, given its held input at the steps."""

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        inner, outer = state
        return (GAIN * u - inner) / SLOW, (inner - outer) / FAST

    return _integrate(equation, 2, drive)


def _integrate(equation: RightHandSide, order: int, drive: Signal) -> Signal:
    """Return the last of several states."""
    return integrate(equation, (0.0,) * order, drive, _STEP, is_held=True)[:, -1]


def _respond(u: Signal, y: Signal) -> Response:
    return Response(u[:, None], y[::PROCESS_STEPS])


def respond_first_order(record: Rng) -> Response:
    """Draw a record of the process of first order without a cause."""
    u = draw_levels(record)
    return _respond(u, _first_order(hold(u)))


def respond_second_order(record: Rng) -> Response:
    """Draw a record of the process of second order without a cause."""
    u = draw_levels(record)
    return _respond(u, _second_order(hold(u)))


def _behind_map(
    make: Callable[[Rng], Callable[[Signal], Signal]], process: Callable[[Signal], Signal]
) -> DrawResponse:
    """Return the draw of a process behind a static map of its input."""

    def draw(plant: Rng, record: Rng) -> Response:
        change, u = make(plant), draw_levels(record)
        return _respond(u, process(hold(change(u))))

    return draw


def _quantise(plant: Rng) -> Callable[[Signal], Signal]:
    step = plant.uniform(0.3, 0.8)
    return lambda u: step * np.round(u / step)


def _asymmetric_gain(plant: Rng) -> Callable[[Signal], Signal]:
    part = random_sign(plant) * plant.uniform(0.1, 0.4)
    return lambda u: u * (1.0 + part * (u > 0.0))


def _absolute_sensor(plant: Rng, record: Rng) -> Response:
    bias, u = plant.uniform(-0.4, 0.4), draw_levels(record)
    return _respond(u, np.abs(_second_order(hold(u)) + bias))


def _clipped_integrator(plant: Rng, record: Rng) -> Response:
    """Stop the first state at limits, without anything that follows them."""
    limit, u = plant.uniform(0.45, 0.75) * 2.0 * GAIN, draw_levels(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        inner, outer = state
        rate = (GAIN * u - inner) / SLOW
        if abs(inner) >= limit and rate * inner > 0.0:
            rate = 0.0
        return rate, (min(max(inner, -limit), limit) - outer) / FAST

    return _respond(u, _integrate(equation, 2, hold(u)))


def _rate_limit(plant: Rng, record: Rng) -> Response:
    limit, u = plant.uniform(1.0, 2.5), draw_levels(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        valve, inner, outer = state
        rate = min(max((u - valve) / 0.05, -limit), limit)
        return rate, (GAIN * valve - inner) / SLOW, (inner - outer) / FAST

    return _respond(u, _integrate(equation, 3, hold(u)))


def _varying_delay(plant: Rng, record: Rng) -> Response:
    mean, part, period = plant.uniform(0.4, 1.0), plant.uniform(0.5, 0.9), plant.uniform(0.2, 0.5) * _DURATION
    phase, u = record.uniform(0.0, 2 * np.pi), draw_levels(record)
    drive = hold(u)
    time = np.arange(drive.size) * _STEP
    late = time - mean * (1.0 + part * np.sin(2 * np.pi * time / period + phase))
    place = np.clip(np.floor(late / _STEP + 1e-9).astype(int), 0, None)
    return _respond(u, _first_order(drive[place]))


def _uneven_process(plant: Rng, record: Rng) -> Response:
    """Cool more slowly, or faster, than it heats."""
    part, u = random_sign(plant) * plant.uniform(0.2, 0.5), draw_levels(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        error = GAIN * u - state[0]
        return (error / TIME * (1.0 + part * (error > 0.0)),)

    return _respond(u, _integrate(equation, 1, hold(u)))


def _radiation(plant: Rng, record: Rng) -> Response:
    """Lose heat by radiation in addition, relative to a surrounding of three units."""
    part, u = plant.uniform(0.3, 1.0), draw_levels(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        loss = part * 3.0 / 4.0 * ((1.0 + state[0] / 3.0) ** 4 - 1.0)
        return ((GAIN * u - state[0] - loss) / TIME,)

    return _respond(u, _integrate(equation, 1, hold(u)))


def _day_wave(plant: Rng, record: Rng) -> Response:
    size, period = plant.uniform(0.1, 0.3), plant.uniform(0.5, 1.0) * _DURATION
    phase, u = record.uniform(0.0, 2 * np.pi), draw_levels(record)
    drive = hold(u)
    wave = size * np.sin(2 * np.pi * np.arange(drive.size) * _STEP / period + phase)
    # The process was in equilibrium with the wave before the record.
    return _respond(
        u, _first_order(drive + wave) + GAIN * wave[0] * np.exp(-np.arange(drive.size) * _STEP / TIME)
    )


def _warm_gain(plant: Rng, record: Rng) -> Response:
    """Change the gain with a temperature that is measured."""
    part, u = random_sign(plant) * plant.uniform(0.02, 0.06), draw_levels(record)
    temperature = np.cumsum(random_noise(record, PROCESS_SAMPLES, 1 / PROCESS_DT, 0.02, 0.1))
    temperature = 10.0 * (temperature - temperature[0]) / np.ptp(temperature)
    y = _first_order(hold(u * (1.0 + part * temperature)))
    return Response(np.column_stack([u, temperature]), y[::PROCESS_STEPS])


def _jacketed_sensor(plant: Rng, record: Rng) -> Response:
    """Follow the process by a sensor whose lag grows with the size of its error, as by boiling."""
    part, lag, u = plant.uniform(1.0, 3.0), plant.uniform(0.5, 1.0), draw_levels(record)

    def equation(_time: float, state: tuple[float, ...], u: float) -> tuple[float, ...]:
        x, shown = state
        return (GAIN * u - x) / TIME, (x - shown) / lag / (1.0 + part * abs(x - shown))

    return _respond(u, _integrate(equation, 2, hold(u)))


def _sticking_valve(plant: Rng, record: Rng) -> Response:
    """Move a valve only if its command differs by more than its stiction, then all the way."""
    band, u = plant.uniform(0.4, 0.9), draw_levels(record)
    place, places = 0.0, []
    for command in u.tolist():
        place = command if abs(command - place) > band else place
        places.append(place)
    return _respond(u, _second_order(hold(np.array(places))))


def _cause(
    name: str,
    summary: str,
    simulation: str,
    draw: DrawResponse,
    names: str,
    terms: str,
    family: str,
    family_terms: str = "",
) -> UnusualCause:
    return UnusualCause(
        *(name, summary, simulation, draw, frozenset(names.split()), terms, frozenset(family.split())),
        family_terms,
        carries=name not in ("day-wave", "varying-delay"),
    )


#: Causes in a process. Terms are of the input and the simulated output, or of the states of its equations.
PROCESS_CAUSES = (
    _cause(
        "quantised-valve",
        "the valve rounds its command to steps",
        "linear:2",
        _behind_map(_quantise, _second_order),
        "quantisation quantised-input quantiser",
        r"round\(",
        "input-curve",
    ),
    _cause(
        "asymmetric-gain",
        "the actuator has another gain for positive commands",
        "linear:1",
        _behind_map(_asymmetric_gain, _first_order),
        "input-curve asymmetric-gain",
        r"max\(u|abs\(u\)",
        "shape",
        r"max\(y|abs\(y",
    ),
    _cause(
        "absolute-sensor",
        "the sensor shows the absolute value",
        "linear:2",
        _absolute_sensor,
        "absolute-value-sensor unsigned-sensor",
        r"abs\(y_sim\)",
        "shape",
        r"max\(y|abs\(",
    ),
    _cause(
        "clipped-integrator",
        "the first state stops at limits",
        "linear:2",
        _clipped_integrator,
        "state-clip",
        "",
        "shape",
    ),
    _cause(
        "rate-limit-in-plant",
        "the valve has a largest rate, and a lag",
        "linear:2",
        _rate_limit,
        "rate-limit",
        "",
        "timing",
    ),
    _cause(
        "varying-delay",
        "the delay swings about its mean by 50 to 90 %",
        "linear:1",
        _varying_delay,
        "varying-delay",
        "",
        "timing",
    ),
    _cause(
        "uneven-process",
        "the process is slower in one direction",
        "linear:1",
        _uneven_process,
        "input-lag-curve output-lag-curve uneven-lag",
        r"abs\(\(.*- x\)/T\)\) in dx/dt",
        "timing",
    ),
    _cause(
        "radiation",
        "heat is lost by the fourth power of the absolute temperature as well",
        "linear:1",
        _radiation,
        "output-curve even-nonlinearity",
        r"(x|y_sim)\*\*[234]|\(x \+ s\d\)\*\*4",
        "shape",
        r"(x|y_sim)\*\*|(abs|max)\((x|y_sim)\b",
    ),
    _cause(
        "day-wave",
        "a slow input that is not measured acts like the input",
        "linear:1",
        _day_wave,
        "baseline-curve",
        "",
        "baseline disturbance",
        r"^a\d+\*\(t",
    ),
    _cause(
        "warm-gain",
        "the gain depends on a temperature that is measured",
        "linear:1",
        _warm_gain,
        "temperature-gain",
        r"(?=.*T_K)(?=.*(\bu\b|y_sim))",
        "change",
        r"(?=.*\bt\b)(?=.*(\bu\b|y_sim))",
    ),
    _cause(
        "uneven-sensor",
        "the lag of the sensor grows with its error",
        "linear:1",
        _jacketed_sensor,
        "output-lag-curve uneven-lag growing-lag",
        "",
        "timing",
    ),
    _cause(
        "sticking-valve",
        "the valve moves only if its command differs by more than a band",
        "linear:2",
        _sticking_valve,
        "stiction",
        "",
        "memory",
    ),
)
