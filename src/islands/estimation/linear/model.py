"""Linear model with its uncertainty, in the units of the record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.regression import (
    Fit,
    Structure,
    linearise,
    map_parameters,
    move,
    project,
    restrict,
)
from islands.estimation.linear.sections import Section, Signal, Signals, find_poles
from islands.kernels.state_space import simulate_state_space
from islands.models.state_space import INTEGRATOR_GAINS, Quantity, StateSpace, measure_mode

#: Part of a standard error by which parameters are moved for the derivatives of quantities.
_STEP = 1e-3


@dataclass(frozen=True, slots=True)
class LinearCandidate:
    """One line of the comparison of orders.

    Attributes
    ----------
    order, integrators : int
        Number of poles, and how many of them are exactly 1.
    criterion : float
        Information criterion of Schwarz, less than others for the better model.
    error : float
        Root mean square of the free run, as a part of the standard deviation of the outputs.
    """

    order: int
    integrators: int
    criterion: float
    error: float


@dataclass(frozen=True, slots=True, eq=False)
class LinearModel:
    """Linear state space with dead times.

    Of every output, ``x(k+1) = A x(k) + B (u - u0) + drift`` and ``y(k) = y0 + C x(k) + D (u - u0)``, where
    input j is that of ``delays[output, j]`` samples before.

    Attributes
    ----------
    a : ndarray, shape (order, order)
        The outputs share the poles.
    b : ndarray, shape (outputs, order, inputs)
    c : ndarray, shape (order,)
    d : ndarray, shape (outputs, inputs)
        Not zero where the dead time is not a whole number of samples, or with a direct path.
    drift : ndarray, shape (outputs, order)
        Zero without an integrator.
    u0, y0 : ndarray, shapes (inputs,) and (outputs,)
        Operating point.
    delays : ndarray of int64, shape (outputs, inputs)
        In samples.
    dt : float
        Sampling time in seconds.
    starts : ndarray, shape (outputs, recordings, order)
        States of every recording at its sample number ``first``.
    first : int
        0, or the largest dead time if inputs before the recordings had other values than their first ones.
    noise : tuple of ndarray, each of shape (2, states)
        Noise of every output: coefficients of its past values, and of the past white noise.
    deviations : ndarray, shape (outputs,)
        Standard deviation of the white noise behind it.
    quantities : tuple of (tuple of Quantity)
        Of every output: time constants, frequencies and damping ratios, gains and dead times.
    errors : tuple of (tuple of float)
        Their standard errors, over the dead times that the record does not exclude; NaN where there is none,
        as of a double pole.
    parameters : ndarray, shape (parameters,)
        Numerators and noise of every output, then the denominators.
    covariance : ndarray, shape (parameters, parameters)
    candidates : tuple of LinearCandidate
        Best model of every order.
    residual : ndarray, shape (outputs, samples)
        Error of the free run of the recordings, NaN where it is not counted.
    """

    a: Signal
    b: Signal
    c: Signal
    d: Signal
    drift: Signal
    u0: Signal
    y0: Signal
    delays: NDArray[np.int64]
    dt: float
    starts: Signal
    first: int
    noise: tuple[Signal, ...]
    deviations: Signal
    quantities: tuple[tuple[Quantity, ...], ...]
    errors: tuple[tuple[float, ...], ...]
    parameters: Signal
    covariance: Signal
    candidates: tuple[LinearCandidate, ...]
    residual: Signal

    @property
    def order(self) -> int:
        """Number of states of an output."""
        return len(self.a)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in discrete time."""
        return np.linalg.eigvals(self.a).astype(np.complex128)

    def state_space(self, output: int = 0) -> StateSpace:
        """Return the linear system of an output about the operating point, with its dead times."""
        return StateSpace(
            A=self.a,
            B=self.b[output],
            C=self.c[None],
            D=self.d[output, None],
            dt=self.dt,
            dead_times=tuple((self.delays[output] * self.dt).tolist()),
            operating_inputs=tuple(self.u0.tolist()),
            operating_outputs=(float(self.y0[output]),),
        )

    def simulate(self, u: Signal, start: Signal | None = None) -> Signal:
        """Simulate the outputs.

        Parameters
        ----------
        u : ndarray, shape (samples, inputs)
            Before the first sample, every input has its first value.
        start : ndarray, shape (outputs, order), optional
            States at the first sample; by default those at rest with the first inputs, of an integrator 0.

        Returns
        -------
        ndarray, shape (samples, outputs)
        """
        u = np.asarray(u, dtype=np.float64).reshape(len(u), -1) - self.u0
        y, codes = np.empty((len(self.d), len(u))), np.zeros(0, np.int64)
        for output, (b, d, drift, level) in enumerate(zip(self.b, self.d, self.drift, self.y0, strict=True)):
            # Repeating the first sample is the way an input waits for its dead time.
            places = np.maximum(np.arange(len(u))[:, None] - self.delays[output], 0)
            late = np.take_along_axis(u, places, axis=0)
            if start is None:
                x = np.linalg.lstsq(np.eye(self.order) - self.a, b @ late[0] + drift, rcond=1e-12)[0]
            else:
                x = np.array(start[output], dtype=np.float64)
            # A simulation ends at large states; they add up an input at most once for each sample.
            growth = len(u) * (np.abs(b) @ np.abs(late).max(axis=0) + np.abs(drift))
            unit = float(np.maximum(growth, np.abs(x)).max(initial=0.0)) or 1.0
            parts = self.a.ravel(), b.ravel() / unit, self.c * unit, d, drift / unit, [level]
            simulate_state_space(np.concatenate(parts), codes, late, x / unit, y[output])
        return y.T


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Units of the signals of a fit: ``(u - u0) / u_unit`` and ``(y - y0) / y_unit``."""

    u0: Signal
    u_unit: Signal
    y0: Signal
    y_unit: Signal
    dt: float


def make_model(
    signals: Signals,
    fit: Fit,
    scales: Scales,
    candidates: Sequence[LinearCandidate] = (),
    rivals: Sequence[Fit] = (),
) -> LinearModel:
    """Return the model of a fit in the units of the record, with standard errors.

    Rivals are fits after a change of the structure. Those with the same modes add to the standard errors by
    the weight that the deviance on another record gives them against the best fit (Buckland, Burnham &
    Augustin 1997): a structure of fewer parameters may have a bias that the criterion of Schwarz does not
    detect. Changes do not exclude each other, so that every one adds its part.
    """
    structure, outputs = fit.structure, len(fit.coefficients)
    noise, theta = restrict(signals, fit).structure.noise, _pack(fit)
    best, *others = [_estimate(signals, each, scales, noise) for each in (fit, *rivals)]
    gains = np.array([fit.expected_deviance - each.expected_deviance for each in rivals])
    weights = (0.5 + 0.5 * np.tanh(0.25 * gains)).tolist()
    parts = [
        _realise(fit.coefficients[output], structure, output, scales, signals.samples)
        for output in range(outputs)
    ]
    a, c = _realise_poles(structure.parts)
    starts = np.array(
        [_scale_starts(fit.starts[output], structure) * scales.y_unit[output] for output in range(outputs)]
    )
    b, d, drift, level = (np.array(each) for each in zip(*parts, strict=True))
    degrees = np.maximum(fit.counts - len(theta) / outputs, 1.0)
    residual = np.full(signals.y.shape, np.nan)
    for begin, end in structure.find_intervals(signals):
        residual[:, begin:end] = fit.residual[:, begin:end] * scales.y_unit[:, None]
    return LinearModel(
        a,
        b,
        c,
        d,
        drift,
        scales.u0,
        scales.y0 + level,
        structure.delays,
        scales.dt,
        starts,
        structure.skipped,
        structure.noise,
        np.sqrt(fit.squares / degrees) * scales.y_unit,
        best.quantities,
        _average(best, others, weights),
        theta,
        best.covariance,
        tuple(candidates),
        residual,
    )


class _MeasuredQuantities(NamedTuple):
    """Quantities of every output, their standard errors, and the covariance of the parameters."""

    quantities: tuple[tuple[Quantity, ...], ...]
    errors: tuple[tuple[float, ...], ...]
    covariance: Signal

    @property
    def kinds(self) -> list[tuple[str, int | None]]:
        """What the quantities are."""
        return [(each.name, each.input) for own in self.quantities for each in own]


def _estimate(signals: Signals, fit: Fit, scales: Scales, noise: tuple[Signal, ...]) -> _MeasuredQuantities:
    """Return the quantities of a fit, with the covariance that another noise gives them."""
    weighed = project(signals, replace(fit.structure, noise=noise)) or fit
    covariance, outputs = estimate_covariance(signals, weighed), range(len(fit.coefficients))

    def measure(values: Signal, near: Fit = weighed) -> list[list[Quantity]]:
        found = _unpack(values, near)
        if found is None:
            return [[] for _ in outputs]
        moved, coefficients = found
        return [list(_measure(moved, coefficients[output], output, scales)) for output in outputs]

    quantities = tuple(map(tuple, measure(_pack(fit), fit)))
    errors = _propagate(measure, quantities, _pack(weighed), covariance)
    return _MeasuredQuantities(quantities, errors, covariance)


def _average(
    best: _MeasuredQuantities, others: Sequence[_MeasuredQuantities], weights: Sequence[float]
) -> tuple[tuple[float, ...], ...]:
    """Return the standard errors of the best estimate, where every change is in the law or not."""
    variances: list[Signal] = [np.square(each) for each in best.errors]
    errors: list[Signal] = [np.array(each) for each in variances]
    for other, weight in zip(others, weights, strict=True):
        if other.kinds == best.kinds:
            for output, (one, two) in enumerate(zip(best.quantities, other.quantities, strict=True)):
                moved = [x.value - y.value for x, y in zip(one, two, strict=True)]
                square = np.square(other.errors[output]) + np.square(moved)
                # A dead time may have no value where the response to an input begins.
                variances[output] += weight * np.fmax(square - errors[output], 0.0)
    return tuple(tuple(np.sqrt(each).tolist()) for each in variances)


def estimate_covariance(signals: Signals, fit: Fit) -> Signal:
    """Return the covariance of numerators and noise of every output and of the poles.

    The coordinates of the poles are those of `regression.differentiate`.
    """
    factors, free = linearise(signals, fit), fit.structure.free
    if factors is None:
        return np.full((len(_pack(fit)), len(_pack(fit))), np.nan)
    size = sum(each.own for each in factors) + free
    information, at = np.zeros((size, size)), 0
    for each, squares, count in zip(factors, fit.squares, fit.counts, strict=True):
        places = [*range(at, at + each.own), *range(size - free, size)]
        rows = each.factor[:, :-1]
        estimated = each.own + free / len(factors)
        information[np.ix_(places, places)] += (
            rows.T @ rows * max(count - estimated, 1.0) / max(squares, 1e-300)
        )
        at += each.own
    unit = np.sqrt(np.diag(information))
    unit[unit == 0.0] = 1.0
    inverse: Signal = np.linalg.pinv(information / np.outer(unit, unit), rcond=1e-13, hermitian=True)
    covariance: Signal = inverse / np.outer(unit, unit)
    return covariance


def _pack(fit: Fit) -> Signal:
    structure, parts = fit.structure, []
    for output, own in enumerate(fit.parameters):
        fractions = structure.fractions[output, structure.find_early(output)]
        parts += [own, structure.noise[output].ravel(), fractions]
    return np.concatenate([*parts, np.zeros(structure.free)])


def _unpack(values: Signal, fit: Fit) -> tuple[Structure, list[Signal]] | None:
    """Return the structure and the coefficients; None if a pole has no continuous time."""
    structure, own, at = fit.structure, list[Signal](), 0
    fractions = structure.fractions.copy()
    for output, parameters in enumerate(fit.parameters):
        own.append(values[at : at + parameters.size])
        at += parameters.size + structure.noise[output].size
        early = structure.find_early(output)
        fractions[output, early] = values[at : at + early.size]
        at += early.size
    moved = replace(structure, sections=move(structure.sections, values[at:]), fractions=fractions)
    samples = fit.signals.samples
    mappings = [map_parameters(structure, output, samples, moved) for output in range(len(own))]
    coefficients = []
    for output, (mapping, parameters) in enumerate(zip(mappings, own, strict=True)):
        if mapping is None:
            return None
        coefficients.append(mapping[-structure.count_coefficients(output) :] @ parameters)
    return moved, coefficients


def _propagate(
    measure: Callable[[Signal], list[list[Quantity]]],
    quantities: tuple[tuple[Quantity, ...], ...],
    theta: Signal,
    covariance: Signal,
) -> tuple[tuple[float, ...], ...]:
    """Return the standard errors of quantities by the delta method, along the axes of the covariance."""
    if not np.isfinite(covariance).all():
        return tuple((np.nan,) * len(own) for own in quantities)
    unit = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    axes = (vectors * np.sqrt(np.maximum(values, 0.0))).T * unit
    variances = [np.zeros(len(each)) for each in quantities]
    for axis in axes:
        sides = [measure(theta + sign * _STEP * axis) for sign in (1.0, -1.0)]
        for output, own in enumerate(quantities):
            above, below = (side[output] for side in sides)
            # At a double pole, a resonance becomes two time constants.
            if (
                not [each.name for each in above]
                == [each.name for each in below]
                == [each.name for each in own]
            ):
                variances[output] += np.nan
                continue
            slopes = [
                (one.value - other.value) / (2.0 * _STEP) for one, other in zip(above, below, strict=True)
            ]
            variances[output] += np.square(slopes)
    return tuple(tuple(np.sqrt(each).tolist()) for each in variances)


def _realise_poles(parts: Sequence[Section]) -> tuple[Signal, Signal]:
    order = sum(section.size for section in parts)
    a, c, at = np.zeros((order, order)), np.zeros(order), 0
    for section in parts:
        a[at : at + section.size, at] = -section
        if section.size == 2:
            a[at, at + 1] = 1.0
        c[at] = 1.0
        at += section.size
    return a, c


def _numerator(section: Section, coefficients: Signal) -> Signal:
    """Return the numerators of ``q^-1``, ``q^-2`` from those of ``q^-1`` and of the difference."""
    if section.size == 1:
        return coefficients
    return np.array([coefficients[0] + coefficients[1], -coefficients[1]])


def _split(structure: Structure, own: Signal, output: int) -> tuple[Signal, Signal]:
    """Return the numerators, shape (order, inputs), and the direct terms, shape (inputs,)."""
    inputs, at = structure.delays.shape[1], 0
    b, d = np.zeros((structure.order, inputs)), np.zeros(inputs)
    for place in range(inputs):
        row = 0
        for section in structure.parts:
            b[row : row + section.size, place] = _numerator(section, own[at : at + section.size])
            row, at = row + section.size, at + section.size
        if structure.leads[output, place]:
            d[place] = own[at]
            at += 1
    return b, d


def _realise(
    own: Signal, structure: Structure, output: int, scales: Scales, samples: int
) -> tuple[Signal, Signal, Signal, float]:
    b, d = _split(structure, own, output)
    gain = scales.y_unit[output] / scales.u_unit
    drift = np.zeros(structure.order)
    if structure.integrators:
        drift[-structure.integrators] = own[-1] / samples * scales.y_unit[output]
    level = 0.0 if structure.integrators else float(own[-1] * scales.y_unit[output])
    return b * gain, d * gain, drift, level


def _scale_starts(starts: Signal, structure: Structure) -> Signal:
    scaled, at = np.array(starts), 0
    for section in structure.parts:
        if section.size == 2:
            scaled[:, at] = starts[:, at] + starts[:, at + 1]
            scaled[:, at + 1] = -starts[:, at + 1]
        at += section.size
    return scaled


def _measure(structure: Structure, own: Signal, output: int, scales: Scales) -> list[Quantity]:
    """Return the continuous-time quantities of an output."""
    b, d = _split(structure, own, output)
    b, d = b * (scales.y_unit[output] / scales.u_unit), d * scales.y_unit[output] / scales.u_unit
    found: list[Quantity] = []
    for section in structure.sections:
        poles = sorted(find_poles([section]).tolist(), key=lambda pole: -pole.real)
        for pole in poles:
            if pole.imag >= 0.0:
                found += measure_mode(pole, scales.dt)
    for place in range(len(d)):
        gain, row = d[place], 0
        for section in structure.sections:
            gain += b[row : row + section.size, place].sum() / (1.0 + section.sum())
            row += section.size
        if structure.integrators:
            name = INTEGRATOR_GAINS[structure.integrators - 1]
            growth = float(b[-structure.integrators :, place].sum()) / scales.dt**structure.integrators
            found.append(Quantity(name, growth, input=place + 1))
        else:
            found.append(Quantity("static gain", float(gain), input=place + 1))
        if place in structure.find_early(output):
            lead = float(structure.fractions[output, place])
        else:
            lead = _find_lead(structure, b[:, place], d[place])
        late = structure.delays[output, place] - lead
        found.append(Quantity("dead time", float(late) * scales.dt, "s", place + 1))
    return found


def _find_lead(structure: Structure, b: Signal, d: float) -> float:
    """Return the part of a sample by which the response to a step begins before its first whole sample.

    The samples of the response lie on a curve of the modes in continuous time. Before the dead time the
    response is zero, and the curve meets zero there; NaN if it does not, as with a direct path.
    """
    if d == 0.0:
        return 0.0
    a, c = _realise_poles(structure.parts)
    # The first samples after the direct term; the curve before them follows from the modes.
    poles, vectors = np.linalg.eig(a.astype(np.complex128))
    if np.abs(poles).min(initial=1.0) < 1e-6:
        return 0.0
    rates, left = np.log(poles), np.linalg.solve(vectors, b.astype(np.complex128))
    weights = (c @ vectors) * left
    times = np.linspace(0.0, -1.0, 201)

    def respond(t: Signal) -> Signal:
        # Sum of weights * (p^t - 1) / (p - 1): for whole t the sum of p^0 .. p^(t-1).
        near = np.abs(poles - 1.0) < 1e-9
        growth = np.where(
            near, t[:, None], (np.exp(np.outer(t, rates)) - 1.0) / np.where(near, 1.0, poles - 1.0)
        )
        found: Signal = d + (growth @ weights).real
        return found

    values = respond(times)
    crossed = np.nonzero(values[1:] * values[:-1] <= 0.0)[0]
    if not crossed.size:
        return np.nan
    at = crossed[0]
    part = values[at] / (values[at] - values[at + 1])
    return float(-(times[at] + part * (times[at + 1] - times[at])))
