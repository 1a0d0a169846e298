"""Least squares of the simulated and whitened error of linear models.

For given poles, dead times and noise, the output is linear in the numerators, the initial states and the
operating point, which are eliminated (variable projection, Golub and Pereyra 1973). Gauss-Newton steps move
the poles and the autoregression of the noise together: a Box-Jenkins model with C = 1, whose estimate is also
consistent in closed loop (Ljung 1999, sections 4.2 and 13.4). All sums are triangular factors of blocks of
samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.sections import (
    BLOCK,
    INTEGRATOR,
    Section,
    Signal,
    Signals,
    divide,
    find_poles,
    is_stable,
    pair_poles,
    respond_freely,
)

#: Singular value, relative to the largest, up to which a direction is not shown by the samples.
_DEPENDENT = 1e-10

#: Halvings of a step.
_MAX_HALVINGS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """What the numerators and the noise belong to.

    Attributes
    ----------
    sections : tuple of ndarray
        Denominators without an integrator.
    integrators : int
        Number of poles at exactly 1: 0 or 1.
    delays : ndarray of int64, shape (outputs, inputs)
        Whole samples before the response to an input begins: it reads lag ``delay + 1`` first.
    leads : ndarray of bool, shape (outputs, inputs)
        Whether it reads lag ``delay`` as well: the dead time is not a whole number of samples.
    noise : tuple of ndarray
        Autoregression of the noise of every output: ``v(k) = c1 v(k-1) + ... + e(k)``.
    held : bool
        Whether an input that begins at rest had its first value before a recording. If not, outputs that read
        inputs before it are not counted.
    """

    sections: tuple[Section, ...]
    integrators: int
    delays: NDArray[np.int64]
    leads: NDArray[np.bool_]
    noise: tuple[Signal, ...]
    held: bool = True

    def count_skipped(self, signals: Signals) -> int:
        """Return the samples of every recording that are not counted; the initial states apply after them.

        An input that changes before its dead time has passed was not at rest before the recording.
        """
        at_rest = self.held and bool((self.delays <= signals.rest).all())
        return 0 if at_rest else int(self.delays.max(initial=0))

    def find_intervals(self, signals: Signals) -> list[tuple[int, int]]:
        """Return the first sample that is counted of every recording, and the sample after its last one."""
        skipped = self.count_skipped(signals)
        return [(begin + skipped, end) for begin, end in signals.bounds]

    @property
    def parts(self) -> tuple[Section, ...]:
        """All sections, that of an integrator last."""
        return self.sections + (INTEGRATOR,) * self.integrators

    @property
    def order(self) -> int:
        """Number of poles."""
        return sum(section.size for section in self.parts)

    @property
    def free(self) -> int:
        """Number of poles that are estimated."""
        return self.order - self.integrators


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A structure with the best numerators.

    Attributes
    ----------
    structure : Structure
    coefficients : tuple of ndarray
        Coefficients of every output: of every input those of the sections and, if it leads, of the direct
        term; last the constant.
    starts : tuple of ndarray
        States of every output at the first sample that is counted, shape (recordings, order).
    residual : ndarray, shape (outputs, samples)
        Error of the free run; zero where it is not counted.
    squares : ndarray, shape (outputs,)
        Sum of squares of the whitened error.
    counts : ndarray, shape (outputs,)
        Samples of the whitened error.
    skipped : int
        Samples of every recording that are not counted.
    """

    structure: Structure
    coefficients: tuple[Signal, ...]
    starts: tuple[Signal, ...]
    residual: Signal
    squares: Signal
    counts: Signal
    skipped: int

    @property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood of all samples, up to a constant.

        Models whose whitening takes different numbers of samples are compared by the mean square. A sample
        that is not counted costs 2, as a parameter does in the criterion of Akaike: the information on an
        input before a recording does not grow with the number of samples.
        """
        mean_squares = np.maximum(self.squares, np.finfo(float).tiny) / self.counts
        outputs, samples = self.residual.shape
        free = outputs * self.skipped * len(self.starts[0])
        return float(samples * np.log(mean_squares).sum() + 2.0 * free)

    @property
    def criterion(self) -> float:
        """Information criterion of Schwarz, with the initial states and a dead time as parameters."""
        structure, samples = self.structure, self.residual.shape[1]
        sizes = [each.size for each in (*self.coefficients, *structure.noise, *self.starts)]
        count = structure.free + sum(sizes) + int(np.count_nonzero(structure.delays))
        return self.deviance + float(np.log(samples)) * count


def make_columns(signals: Signals, structure: Structure, output: int) -> Signal:
    """Return the responses of an output to the inputs and to a constant, shape (coefficients, samples)."""
    columns = []
    for place, (delay, leads) in enumerate(
        zip(structure.delays[output].tolist(), structure.leads[output].tolist(), strict=True)
    ):
        late = signals.late(place, delay)[None]
        columns += [divide(section, late, signals.ends)[0] for section in structure.parts]
        if leads:
            columns.append(late)
    constant = np.ones((1, signals.samples))
    if structure.integrators:
        constant = divide(INTEGRATOR, constant, signals.ends)[0] / signals.samples
    return np.concatenate([*columns, constant])


class _Projection(NamedTuple):
    """Best numerators of one output, its initial states, its error, and the sum of the whitened squares."""

    coefficients: Signal
    starts: Signal
    residual: Signal
    squares: float


def project(signals: Signals, structure: Structure) -> Fit | None:
    """Return the fit with the best numerators; None if it is not finite."""
    found = [_project(signals, structure, output) for output in range(len(structure.noise))]
    squares = np.array([each.squares for each in found])
    if not np.isfinite(squares).all():
        return None
    skipped = structure.count_skipped(signals)
    lost = [(skipped + noise.size) * signals.ends.size for noise in structure.noise]
    return Fit(
        structure,
        tuple([each.coefficients for each in found]),
        tuple([each.starts for each in found]),
        np.array([each.residual for each in found]),
        squares,
        signals.samples - np.array(lost, np.float64),
        skipped,
    )


def _project(signals: Signals, structure: Structure, output: int) -> _Projection:
    columns, noise, order = make_columns(signals, structure, output), structure.noise[output], structure.order
    rows, intervals = np.vstack([columns, signals.y[output]]), structure.find_intervals(signals)
    responses = respond_freely(structure.parts, max(end - begin for begin, end in intervals))
    factors = [
        triangulate(np.vstack([responses[:, : end - begin], rows[:, begin:end]]), noise)
        for begin, end in intervals
    ]
    whole, count = factor_rows(np.vstack([factor[order:, order:] for factor in factors])), len(columns)
    coefficients = solve(whole[:count, :count], whole[:count, count])
    rest = whole[:, count] - whole[:, :count] @ coefficients
    error, starts = signals.y[output] - coefficients @ columns, np.zeros((len(factors), order))
    residual = np.zeros(signals.samples)
    for (begin, end), factor, start in zip(intervals, factors, starts, strict=True):
        moment = factor[:order, -1] - factor[:order, order:-1] @ coefficients
        start[:] = solve(factor[:order, :order], moment)
        residual[begin:end] = error[begin:end] - start @ responses[:, : end - begin]
    return _Projection(coefficients, starts, residual, float(rest @ rest))


def whiten(rows: Signal, noise: Signal) -> Signal:
    """Return rows of one recording filtered by the inverse of the noise, without the first samples."""
    size = noise.size
    filtered = rows[:, size:]
    for lag, coefficient in enumerate(noise, start=1):
        filtered = filtered - coefficient * rows[:, size - lag : rows.shape[1] - lag]
    return filtered


def triangulate(rows: Signal, noise: Signal, extra: Signal | None = None) -> Signal:
    """Return the triangular factor of whitened rows as columns, square, of blocks of samples."""
    filtered = whiten(rows, noise)
    if extra is not None:
        filtered = np.vstack([filtered[:-1], extra, filtered[-1:]])
    size, samples = filtered.shape
    parts = [factor_rows(filtered[:, begin : begin + BLOCK].T) for begin in range(0, samples, BLOCK)]
    factor = parts[0] if len(parts) == 1 else factor_rows(np.vstack(parts))
    return np.vstack([factor, np.zeros((size - len(factor), size))]) if len(factor) < size else factor


def factor_rows(rows: Signal) -> Signal:
    """Return the triangular factor of a matrix."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def solve(factor: Signal, moment: Signal) -> Signal:
    """Return the least-squares solution; directions that the samples do not show stay at zero."""
    norms = np.linalg.norm(factor, axis=0)
    norms[norms == 0.0] = 1.0
    solution: Signal = np.linalg.lstsq(factor / norms, moment, rcond=_DEPENDENT)[0] / norms
    return solution


class OutputFactor(NamedTuple):
    """Triangular factor of one output: its own parameters first, then the poles, then the error."""

    factor: Signal
    own: int


def differentiate(signals: Signals, fit: Fit, output: int) -> Signal:
    """Return the derivatives of an output with respect to the poles, shape (free poles, samples).

    Those of a section of two coefficients are with respect to ``a1 + a2`` and ``-a2``.
    """
    structure = fit.structure
    parts = _simulate_parts(signals, fit, output)
    found = [
        -divide(section, part[None], signals.ends)[0]
        for section, part in zip(structure.sections, parts, strict=False)
    ]
    return np.concatenate([np.zeros((0, signals.samples)), *found])


def _simulate_parts(signals: Signals, fit: Fit, output: int) -> Signal:
    """Return the part of every free section in the output, shape (sections, samples)."""
    structure, own = fit.structure, fit.coefficients[output]
    columns = make_columns(signals, structure, output)
    parts, at = np.zeros((len(structure.sections), signals.samples)), 0
    for leads in structure.leads[output]:
        for place, section in enumerate(structure.parts):
            if place < len(parts):
                parts[place] += own[at : at + section.size] @ columns[at : at + section.size]
            at += section.size
        at += int(leads)
    intervals = structure.find_intervals(signals)
    responses = respond_freely(structure.sections, max(end - begin for begin, end in intervals))
    for (begin, end), start in zip(intervals, fit.starts[output], strict=True):
        at = 0
        for place, section in enumerate(structure.sections):
            rows = slice(at, at + section.size)
            parts[place, begin:end] += start[rows] @ responses[rows, : end - begin]
            at += section.size
    return parts


def linearise(signals: Signals, fit: Fit) -> list[OutputFactor]:
    """Return the factors of every output at a fit."""
    structure, found = fit.structure, []
    intervals = structure.find_intervals(signals)
    for output, noise in enumerate(structure.noise):
        columns = make_columns(signals, structure, output)
        rows = np.vstack([columns, differentiate(signals, fit, output), fit.residual[output]])
        responses = respond_freely(structure.parts, max(end - begin for begin, end in intervals))
        order, count, size = structure.order, len(columns), noise.size
        factors = []
        for begin, end in intervals:
            late = [fit.residual[output, begin + size - lag : end - lag] for lag in range(1, size + 1)]
            part = np.vstack([responses[:, : end - begin], rows[:, begin:end]])
            extra = np.array(late).reshape(size, end - begin - size)
            factors.append(triangulate(part, noise, extra)[order:, order:])
        factor = factor_rows(np.vstack(factors))
        # The noise follows the columns.
        places = [*range(count), *range(count + structure.free, count + structure.free + size)]
        places += [*range(count, count + structure.free), factor.shape[1] - 1]
        found.append(OutputFactor(factor_rows(factor[:, places]), count + size))
    return found


def step(signals: Signals, fit: Fit) -> Fit | None:
    """Return the fit after a Gauss-Newton step of poles and noise; None if no step reduces the deviance."""
    factors = linearise(signals, fit)
    structure = fit.structure
    free = structure.free
    deviations = np.sqrt(np.maximum(fit.squares / fit.counts, np.finfo(float).tiny))
    shared = np.vstack(
        [each.factor[each.own :, each.own :] / s for each, s in zip(factors, deviations, strict=True)]
    )
    moved = solve(shared[:, :free], shared[:, free]) if free else np.zeros(0)
    changes = []
    for each, before in zip(factors, structure.noise, strict=True):
        own = each.own
        target = each.factor[:own, -1] - each.factor[:own, own : own + free] @ moved
        changes.append(solve(each.factor[:own, :own], target)[own - before.size :])
    for halving in range(_MAX_HALVINGS):
        scale = 0.5**halving
        sections = _join_neighbours(move(structure.sections, scale * moved))
        noise = tuple([old + scale * new for old, new in zip(structure.noise, changes, strict=True)])
        if not all(map(is_stable, sections)):
            continue
        found = project(signals, replace(structure, sections=sections, noise=noise))
        if found is not None and found.deviance < fit.deviance:
            return found
    return None


def move(sections: Sequence[Section], moved: Signal) -> tuple[Section, ...]:
    """Return sections after a step in the coordinates of `differentiate`."""
    found, at = [], 0
    for section in sections:
        change = moved[at : at + section.size]
        found.append(
            section + (np.array([change[0] + change[1], -change[1]]) if section.size == 2 else change)
        )
        at += section.size
    return tuple(found)


def _join_neighbours(sections: Sequence[Section]) -> tuple[Section, ...]:
    """Return sections of neighbouring real poles, so that a double pole stays in one of them."""
    poles = find_poles(sections)
    return tuple(pair_poles(poles)) if np.count_nonzero(poles.imag == 0.0) > 2 else tuple(sections)


def minimise(signals: Signals, fit: Fit, steps: int, least: float = 1e-3) -> Fit:
    """Return the fit after steps that each reduce the deviance by at least a given amount."""
    for _ in range(steps):
        found = step(signals, fit)
        if found is None:
            break
        gain, fit = fit.deviance - found.deviance, found
        if gain < least:
            break
    return fit
