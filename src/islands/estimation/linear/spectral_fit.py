"""State space of several inputs and outputs with shared states, by the error of its free run in spectra.

    x(k+1) = A x(k) + B u(k) + E h(k),    h(k) = a (W x(k) + V u(k))
    y(k)   = C x(k) + D u(k) + F h(k)

The feedback through h is proportional to the amplitude a of the inputs, less a mean one. This is the first
order of what hysteresis of actuators does to the response: gain, losses and stiffness change with the
amplitude (describing function of the law of Rayleigh). There are as many signals h as inputs, since every
actuator has its own, or none in a linear system.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.frequency_response import FrequencyResponse
from islands.estimation.linear.subspace import find_subspace

Matrix = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

#: Orders of the first comparison.
ORDERS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 36, 40)

#: Steps, and the relative decrease that ends them.
_STEPS, _DECREASE = 30, 1e-3

#: Damping of the first step, its factors after a success and after a failure, and failures that end a fit.
_DAMPING, _EASIER, _HARDER, _FAILURES = 1e-3, 0.2, 4.0, 8

#: Starts of the effect of the amplitude, and the change of a pole that the weights of one make about.
_STARTS, _SMALL = 2, 1e-3

#: Information of a direction, relative to the largest, up to which it is a change of the coordinates.
_NO_EFFECT = 1e-12

#: Least difference of two real poles of a section, from which it may pass to a complex pair.
_LEAST_DISTANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ResponseAtAmplitude:
    """Response of the blocks of a record that have about the same amplitude.

    Attributes
    ----------
    response : FrequencyResponse
    amplitude : float
        Less the mean one of the record.
    """

    response: FrequencyResponse
    amplitude: float


@dataclass(frozen=True, slots=True, eq=False)
class SharedSystem:
    """State space of the equations above.

    Attributes
    ----------
    a, b, c, d : ndarray
        A has blocks of two states ``[[p, q], [r, p]]`` with poles ``p +- sqrt(q r)``, and at most one more
        real pole.
    e, f, w, v : ndarray
        Without columns, and without rows, in a linear system.
    is_direct : bool
        Whether the outputs read the inputs of the same sample; D and F are zero if not.
    deviance : float
        Squared errors of the response, each relative to its variance.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    e: Matrix
    f: Matrix
    w: Matrix
    v: Matrix
    is_direct: bool = True
    deviance: float = np.inf

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    @property
    def signals(self) -> int:
        """Number of signals of the feedback."""
        return len(self.w)

    @property
    def size(self) -> int:
        """Number of parameters that have an effect: scales of the states and of the signals have none."""
        # A scale of every state replaces the poles in the count.
        blocks: list[Matrix] = [getattr(self, each) for each in self.free]
        return sum(each.size for each in blocks) - self.signals**2

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the blocks without zeros, besides A."""
        return ("b", "c", "d", "e", "f", "w", "v") if self.is_direct else ("b", "c", "e", "w", "v")

    def at_amplitude(self, amplitude: float) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """Return A, B, C and D of the linear system at an amplitude."""
        w, v = amplitude * self.w, amplitude * self.v
        return self.a + self.e @ w, self.b + self.e @ v, self.c + self.f @ w, self.d + self.f @ v

    def is_stable(self, amplitudes: Sequence[float]) -> bool:
        """Return whether all poles are stable at all amplitudes."""
        return all(
            float(np.abs(np.linalg.eigvals(self.at_amplitude(each)[0])).max(initial=0.0)) < 1.0
            for each in amplitudes
        )


def fit_shared_system(data: Sequence[ResponseAtAmplitude], max_order: int) -> SharedSystem | None:
    """Fit a linear system of the order of the least information criterion to the first response.

    Parameters
    ----------
    data : sequence of ResponseAtAmplitude
        The first one is that of the amplitude about which the system is linear.
    max_order : int

    Returns
    -------
    SharedSystem or None
        None if no order is possible.
    """
    first = data[:1]
    response = first[0].response
    lines, outputs, inputs = response.values.shape
    most = min(max_order, lines * inputs // (2 * (outputs + inputs)))
    if most < 1:
        return None
    subspace = find_subspace(response, most)
    orders = [each for each in ORDERS if each <= min(most, subspace.vectors.shape[1])]
    started = []
    for order in orders:
        start = _start(response, *subspace.find_states(order))
        started.append(replace(start, deviance=_measure(start, first)))
    place = min(range(len(orders)), key=lambda at: find_criterion(started[at], first))
    best = refine(started[place], first)
    # The steps improve small orders more than large ones.
    for smaller in started[:place][::-1]:
        found = refine(smaller, first)
        if find_criterion(found, first) >= find_criterion(best, first):
            break
        best = found
    without = refine(replace(best, d=np.zeros_like(best.d), is_direct=False), first)
    return min(best, without, key=lambda each: find_criterion(each, first))


def schedule(system: SharedSystem, data: Sequence[ResponseAtAmplitude], seed: int) -> SharedSystem:
    """Return the system with an effect of the amplitude, fitted to all responses.

    The feedback begins at the inputs, where actuators are, with small random weights: from none, the steps
    end at other minima. The best of a few starts is taken.

    Parameters
    ----------
    system : SharedSystem
        Linear system at the amplitude zero.
    data : sequence of ResponseAtAmplitude
    seed : int
    """
    generator = np.random.default_rng(seed)
    inputs = system.d.shape[1]
    found = []
    for _ in range(_STARTS):
        weights = generator.standard_normal((inputs, system.order)) / np.linalg.norm(system.b, axis=1)
        start = replace(system, e=system.b, f=system.d, w=_SMALL * weights, v=np.zeros((inputs, inputs)))
        found.append(refine(start, data))
    return min(found, key=lambda each: each.deviance)


def find_criterion(system: SharedSystem, data: Sequence[ResponseAtAmplitude]) -> float:
    """Return the information criterion of Schwarz."""
    count = sum(2 * each.response.values.size for each in data)
    return system.deviance + log(max(count, 2)) * system.size


def _start(response: FrequencyResponse, a: Matrix, c: Matrix) -> SharedSystem:
    """Return the system of A and C in sections; B and D have the least error."""
    a, c = _write_in_sections(a, c)
    lines, outputs, inputs = response.values.shape
    order = len(a)
    resolvent = np.exp(1j * response.frequencies)[:, None, None] * np.eye(order) - a
    states = np.linalg.solve(resolvent.swapaxes(1, 2), np.broadcast_to(c.T + 0j, (lines, order, outputs)))
    columns = np.concatenate(
        [states.swapaxes(1, 2), np.broadcast_to(np.eye(outputs), (lines, outputs, outputs))], axis=2
    )
    deviations = np.sqrt(response.variances)[:, None]
    columns, sides = columns / deviations, response.values / deviations
    # The power of the inputs differs little between the lines next to each other: its trace is the weight.
    weight = np.sqrt(np.einsum("fii->f", response.power).real / inputs)[:, None, None]
    left = (columns * weight).reshape(lines * outputs, -1)
    right = (sides * weight).reshape(lines * outputs, inputs)
    found = np.linalg.lstsq(
        np.vstack([left.real, left.imag]), np.vstack([right.real, right.imag]), rcond=1e-12
    )[0]
    b, d = found[:order], found[order:]
    # States of equal gains from the inputs and to the outputs have equal digits.
    scale = np.sqrt(
        np.maximum(np.linalg.norm(c, axis=0), 1e-12) / np.maximum(np.linalg.norm(b, axis=1), 1e-12)
    )
    for at in range(0, order - 1, 2):
        scale[at : at + 2] = np.sqrt(scale[at] * scale[at + 1])
    none = np.zeros((order, 0)), np.zeros((outputs, 0)), np.zeros((0, order)), np.zeros((0, inputs))
    return SharedSystem(a, b * scale[:, None], c / scale, d, *none)


def _write_in_sections(a: Matrix, c: Matrix) -> tuple[Matrix, Matrix]:
    """Return A and C for states of which each pair has its own poles."""
    poles, vectors = np.linalg.eig(a)
    pairs = [place for place in np.argsort(np.abs(np.angle(poles))) if poles[place].imag > 0.0]
    real = [place for place in np.argsort(-poles.real) if poles[place].imag == 0.0]
    order = len(a)
    found, columns = np.zeros((order, order)), []
    at = 0
    for place in pairs:
        pole = poles[place]
        found[at : at + 2, at : at + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        columns += [vectors[:, place].real, vectors[:, place].imag]
        at += 2
    for one, other in zip(real[::2], real[1::2], strict=False):
        middle = 0.5 * (poles[one] + poles[other]).real
        half = max(0.5 * (poles[one] - poles[other]).real, _LEAST_DISTANCE)
        found[at : at + 2, at : at + 2] = [[middle, half], [half, middle]]
        first, second = vectors[:, one].real, vectors[:, other].real
        columns += [first + second, first - second]
        at += 2
    if len(real) % 2:
        found[at, at] = poles[real[-1]].real
        columns.append(vectors[:, real[-1]].real)
    return found, c @ np.column_stack(columns)


class _Factors:
    """Factors of a response and of its derivatives at the frequencies of the data, with their weights."""

    def __init__(self, system: SharedSystem, data: ResponseAtAmplitude) -> None:
        response, level = data.response, data.amplitude
        lines = len(response.values)
        a, b, c, d = system.at_amplitude(level)
        resolvent = np.exp(1j * response.frequencies)[:, None, None] * np.eye(len(a)) - a
        self.states: Spectrum = np.linalg.solve(resolvent, np.broadcast_to(b + 0j, (lines, *b.shape)))
        self.resolvent, self.c = resolvent, c
        self.root: Spectrum = np.asarray(np.linalg.cholesky(response.power), np.complex128)
        self.deviations = np.sqrt(response.variances)[:, None]
        error = (response.values - c @ self.states - d) @ self.root
        self.error: Spectrum = np.asarray(error / self.deviations, np.complex128)

    def differentiate(self, system: SharedSystem, level: float) -> Spectrum:
        """Return the derivatives of the response, shape (lines * outputs * inputs, parameters)."""
        lines, outputs, inputs = self.error.shape
        order = system.order
        rows: Spectrum = np.linalg.solve(
            self.resolvent.swapaxes(1, 2), np.broadcast_to(self.c.T + 0j, (lines, order, outputs))
        ).swapaxes(1, 2)
        rows = rows / self.deviations
        root = self.root
        states: Spectrum = self.states @ root
        direct = np.broadcast_to(np.eye(outputs) / self.deviations, (lines, outputs, outputs))
        fed_back = level * (system.w @ states + system.v @ root)
        effects = level * (rows @ system.e + direct @ system.f)
        poles = [
            each
            for at in range(0, order - 1, 2)
            for each in (
                _multiply(rows, states, at, at) + _multiply(rows, states, at + 1, at + 1),
                _multiply(rows, states, at, at + 1),
            )
        ]
        poles += [_multiply(rows, states, order - 1, order - 1)] if order % 2 else []
        pairs: dict[str, tuple[Spectrum | Matrix, Spectrum]] = {
            "b": (rows, root),
            "c": (direct, states),
            "d": (direct, root),
            "e": (rows, fed_back),
            "f": (direct, fed_back),
            "w": (effects, states),
            "v": (effects, root),
        }
        blocks = [np.stack(poles, axis=-1), *(_combine(*pairs[name]) for name in system.free)]
        slopes: Spectrum = np.concatenate(blocks, axis=-1).reshape(lines * outputs * inputs, -1)
        return slopes


def _multiply(rows: Spectrum, states: Spectrum, row: int, state: int) -> Spectrum:
    found: Spectrum = rows[:, :, row, None] * states[:, None, state, :]
    return found


def _combine(left: Spectrum | Matrix, right: Spectrum) -> Spectrum:
    """Return the derivatives with respect to the matrix between two factors, row by row."""
    found: Spectrum = np.einsum("foi,fjk->fokij", left, right)
    return found.reshape(*found.shape[:3], -1)


def refine(system: SharedSystem, data: Sequence[ResponseAtAmplitude]) -> SharedSystem:
    """Return the system after Levenberg-Marquardt steps with exact derivatives.

    Parameters
    ----------
    system : SharedSystem
    data : sequence of ResponseAtAmplitude
    """
    levels = [each.amplitude for each in data]
    system = replace(system, deviance=_measure(system, data))
    damping = _DAMPING
    for _ in range(_STEPS):
        normal, side = _sum_products(system, data)
        unit = np.sqrt(np.diag(normal))
        unit[unit == 0.0] = 1.0
        scaled = normal / np.outer(unit, unit)
        before = system.deviance
        for _ in range(_FAILURES):
            step = np.linalg.solve(scaled + damping * np.eye(len(unit)), side / unit) / unit
            moved = _move(system, step)
            if moved.is_stable(levels):
                moved = replace(moved, deviance=_measure(moved, data))
                if moved.deviance < before:
                    system, damping = moved, max(damping * _EASIER, 1e-9)
                    break
            damping *= _HARDER
        if not system.deviance < (1.0 - _DECREASE) * before:
            break
    return system


def _sum_products(system: SharedSystem, data: Sequence[ResponseAtAmplitude]) -> tuple[Matrix, Matrix]:
    """Return the products of the derivatives with each other, and with the errors."""
    normal, side = 0.0, 0.0
    for each in data:
        factors = _Factors(system, each)
        slopes = factors.differentiate(system, each.amplitude)
        rows = np.concatenate([slopes.real, slopes.imag])
        errors = factors.error.reshape(-1)
        normal = normal + rows.T @ rows
        side = side + rows.T @ np.concatenate([errors.real, errors.imag])
    return np.asarray(normal), np.asarray(side)


def draw_systems(
    system: SharedSystem, data: Sequence[ResponseAtAmplitude], draws: int, generator: np.random.Generator
) -> list[SharedSystem]:
    """Draw systems from the distribution of the estimate, a normal one with the inverse of the information.

    The error of a complex line has half of its variance in each part. A lack of fit increases the variances.
    Coordinates of the states have no information, and are not moved.

    Parameters
    ----------
    system : SharedSystem
        Result of `refine` with these data.
    data : sequence of ResponseAtAmplitude
    draws : int
    generator : Generator

    Returns
    -------
    list of SharedSystem
        Stable systems; fewer than ``draws`` if a step leads to an unstable one.
    """
    normal, _ = _sum_products(system, data)
    unit = np.sqrt(np.diag(normal))
    unit[unit == 0.0] = 1.0
    values, vectors = np.linalg.eigh(normal / np.outer(unit, unit))
    kept = values > _NO_EFFECT * values[-1]
    degrees = sum(each.response.values.size for each in data) - 0.5 * np.count_nonzero(kept)
    variance = 0.5 * system.deviance / max(degrees, 1.0)
    axes = vectors[:, kept] * np.sqrt(variance / values[kept]) / unit[:, None]
    moved = [_move(system, axes @ each) for each in generator.standard_normal((draws, axes.shape[1]))]
    levels = [each.amplitude for each in data]
    return [each for each in moved if each.is_stable(levels)]


def _measure(system: SharedSystem, data: Sequence[ResponseAtAmplitude]) -> float:
    return float(sum(np.sum(np.abs(_Factors(system, each).error) ** 2) for each in data))


def _move(system: SharedSystem, step: Matrix) -> SharedSystem:
    a, at = system.a.copy(), 0
    for place in range(0, system.order - 1, 2):
        a[place, place] += step[at]
        a[place + 1, place + 1] += step[at]
        a[place, place + 1] += step[at + 1]
        at += 2
    if system.order % 2:
        a[-1, -1] += step[at]
        at += 1
    moved: dict[str, Any] = {"a": a}
    for name in system.free:
        block = getattr(system, name)
        moved[name] = block + step[at : at + block.size].reshape(block.shape)
        at += block.size
    return replace(system, **moved)
