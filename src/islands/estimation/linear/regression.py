"""Least squares of the simulated and whitened error of linear models.

For given poles, dead times and noise, the output is linear in the numerators, the initial states and the
operating point, which are eliminated (variable projection, Golub and Pereyra 1973). Gauss-Newton steps move
the poles and the noise together: a Box-Jenkins model, whose estimate is also consistent in closed loop (Ljung
1999, sections 4.2 and 13.4). All sums are triangular factors of blocks of samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.noise import limit_zeros
from islands.estimation.linear.sections import (
    INTEGRATORS,
    Section,
    Signal,
    Signals,
    find_poles,
    is_stable,
    pair_poles,
)
from islands.kernels.parallel_sections import factor_sections, solve_rows

#: A column that keeps at most this part of its norm depends on the columns before it.
_DEPENDENT = 1e-10

#: Reduction of the deviance for which no step is taken: it is no reason to prefer a model.
_NEGLIGIBLE = 1e-3

#: Halvings of a step.
_MAX_HALVINGS = 8


@dataclass(frozen=True, eq=False)
class Structure:
    """What the numerators and the noise belong to.

    Attributes
    ----------
    sections : tuple of ndarray
        Denominators without an integrator.
    integrators : int
        Number of poles at exactly 1: 0, 1 or 2.
    delays : ndarray of int64, shape (outputs, inputs)
        Whole samples before the response to an input begins: it reads lag ``delay + 1`` first.
    leads : ndarray of bool, shape (outputs, inputs)
        Whether it reads lag ``delay`` as well: the dead time is not a whole number of samples.
    noise : tuple of ndarray, each of shape (2, states)
        Noise of every output: ``v(k) = d1 v(k-1) + ... + e(k) + c1 e(k-1) + ...``, d in the first row.
    before : ndarray, shape (recordings, inputs), optional
        Values of the inputs before every recording. If they are not known, outputs that read them are not
        counted.
    """

    sections: tuple[Section, ...]
    integrators: int
    delays: NDArray[np.int64]
    leads: NDArray[np.bool_]
    noise: tuple[Signal, ...]
    before: Signal | None

    @property
    def skipped(self) -> int:
        """Samples of every recording that are not counted; the initial states apply after them."""
        return int(self.delays.max(initial=0)) if self.before is None else 0

    def find_intervals(self, signals: Signals) -> list[tuple[int, int]]:
        """Return the first sample that is counted of every recording, and the sample after its last one."""
        return [(begin + self.skipped, end) for begin, end in signals.bounds]

    def count_coefficients(self, output: int) -> int:
        """Return the number of the coefficients of an output."""
        return len(self.leads[output]) * self.order + int(np.count_nonzero(self.leads[output])) + 1

    @cached_property
    def filters(self) -> tuple[Signal, NDArray[np.int64]]:
        """Coefficients of all sections, shape (sections, 2), and how many each one has."""
        padded = np.zeros((len(self.parts), 2))
        for row, section in zip(padded, self.parts, strict=True):
            row[: section.size] = section
        return padded, np.array([section.size for section in self.parts], np.int64)

    @cached_property
    def parts(self) -> tuple[Section, ...]:
        """All sections, that of the integrators last."""
        return self.sections + INTEGRATORS[self.integrators]

    @cached_property
    def order(self) -> int:
        """Number of poles."""
        return sum(section.size for section in self.parts)

    @property
    def free(self) -> int:
        """Number of poles that are estimated."""
        return self.order - self.integrators


@dataclass(frozen=True, eq=False)
class Fit:
    """A structure with the best numerators.

    Attributes
    ----------
    signals : Signals
    structure : Structure
    coefficients : tuple of ndarray
        Coefficients of every output: of every input those of the sections and, if it leads, of the direct
        term; last the constant.
    states : tuple of ndarray
        States of the noise and of the sections of every output at the first sample that is counted, shape
        (recordings, states).
    squares : ndarray, shape (outputs,)
        Sum of squares of the whitened error.
    counts : ndarray, shape (outputs,)
        Samples of the whitened error.
    """

    signals: Signals
    structure: Structure
    coefficients: tuple[Signal, ...]
    states: tuple[Signal, ...]
    squares: Signal
    counts: Signal

    @cached_property
    def residual(self) -> Signal:
        """Error of the free run, shape (outputs, samples); zero where it is not counted."""
        residual, nothing = np.zeros(self.signals.y.shape), np.empty((0, 0))
        for output, (coefficients, states) in enumerate(zip(self.coefficients, self.states, strict=True)):
            rest = coefficients, states, False, residual[output], nothing, np.empty((0, 0, 0))
            _run(self.signals, self.structure, output, *rest)
        return residual

    @property
    def starts(self) -> tuple[Signal, ...]:
        """States of the sections of every output at the first counted sample, shape (recordings, order)."""
        return tuple([states[:, states.shape[1] - self.structure.order :] for states in self.states])

    @cached_property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood of all samples, up to a constant.

        Models that count different numbers of samples are compared by the mean square. An input before a
        recording and a sample that is not counted cost 2, as a parameter does in the criterion of Akaike: the
        information on them does not grow with the number of samples.
        """
        return self.measure_deviance(self.squares)

    def measure_deviance(self, squares: Signal) -> float:
        """Return the deviance for given sums of squares."""
        mean_squares = np.maximum(squares, np.finfo(float).tiny) / self.counts
        return float(self.signals.samples * np.log(mean_squares).sum() + 2.0 * self._bounded)

    @cached_property
    def _bounded(self) -> int:
        """Number of values on which the information does not grow with the number of samples."""
        before, first = self.structure.before, self.signals.first
        levels = 0 if before is None else int(np.count_nonzero(before != first))
        return len(self.states) * len(first) * self.structure.skipped + levels

    @property
    def criterion(self) -> float:
        """Information criterion of Schwarz, with the initial states and a dead time as parameters."""
        structure, samples = self.structure, self.signals.samples
        sizes = [each.size for each in (*self.coefficients, *structure.noise, *self.starts)]
        count = structure.free + sum(sizes) + int(np.count_nonzero(structure.delays))
        return self.deviance + float(np.log(samples)) * count


def project(signals: Signals, structure: Structure) -> Fit | None:
    """Return the fit with the best numerators; None if it is not finite or its noise not invertible."""
    if not all(is_invertible(each, signals.samples) for each in structure.noise):
        return None
    recordings, coefficients, states = signals.ends.size, [], []
    squares = np.empty(len(structure.noise))
    for output, noise in enumerate(structure.noise):
        zero = np.zeros(structure.count_coefficients(output))
        factor, own = _factor(
            signals, structure, output, zero, np.zeros((recordings, noise.shape[1] + structure.order))
        )
        found = solve(factor[:, :-1], factor[:, -1], _measure_columns(factor, own)[:-1])
        squares[output] = found.squares
        coefficients.append(found.values)
        states.append(np.array([_solve_states(rows, found.values) for rows in own]))
    if not np.isfinite(squares).all():
        return None
    counts = np.full(squares.size, float(signals.samples - structure.skipped * recordings))
    return Fit(signals, structure, tuple(coefficients), tuple(states), squares, counts)


def _factor(
    signals: Signals,
    structure: Structure,
    output: int,
    coefficients: Signal,
    states: Signal,
    derivatives: bool = False,
) -> tuple[Signal, Signal]:
    """Return the factor of an output, and of every recording the rows of its initial states.

    Columns of the factor are those of the coefficients, of the noise and the poles if they are requested, and
    the residual. Rows of the initial states begin with their own columns.
    """
    noise = structure.noise[output]
    size = coefficients.size + (noise.size + structure.free if derivatives else 0) + 1
    factor, own = np.empty((size, size)), np.empty((*states.shape, states.shape[1] + size))
    _run(signals, structure, output, coefficients, states, derivatives, np.empty(0), factor, own)
    return factor, own


def _run(signals: Signals, structure: Structure, output: int, *rest: Any) -> None:
    """Call the kernel for an output."""
    factor_sections(
        signals.u,
        signals.y[output],
        signals.ends,
        signals.first if structure.before is None else structure.before,
        structure.skipped,
        *structure.filters,
        len(structure.parts) - len(structure.sections),
        structure.delays[output],
        structure.leads[output],
        structure.noise[output],
        *rest,
    )


def _measure_columns(factor: Signal, own: Signal) -> Signal:
    """Return the norms of the columns over all samples."""
    order = own.shape[1]
    norms: Signal = np.sqrt(np.square(factor).sum(axis=0) + np.square(own[:, :, order:]).sum(axis=(0, 1)))
    return norms


def _solve_states(rows: Signal, coefficients: Signal) -> Signal:
    """Return the initial states of a recording."""
    order = len(rows)
    moment = rows[:, -1] - rows[:, order : order + coefficients.size] @ coefficients
    return solve(rows[:, :order], moment).values


class Solution(NamedTuple):
    """Solution of linear equations, and the sum of squares that it leaves."""

    values: Signal
    squares: float


def solve(rows: Signal, moment: Signal, units: Signal | None = None) -> Solution:
    """Return the least-squares solution; columns that depend on those before them have the value 0.

    Parameters
    ----------
    rows : ndarray, shape (equations, unknowns)
    moment : ndarray, shape (equations,)
    units : ndarray, shape (unknowns,), optional
        Norms of the columns in the equations that the rows come from; by default those of the rows.
    """
    count, unknowns = rows.shape
    equations, values = np.empty((count, unknowns + 1)), np.empty(unknowns)
    equations[:, :-1], equations[:, -1] = rows, moment
    norms = np.sqrt(np.square(rows).sum(axis=0)) if units is None else units
    return Solution(values, solve_rows(equations, norms, _DEPENDENT, values))


class OutputFactor(NamedTuple):
    """Triangular factor of one output: its own parameters first, then the poles, then the error.

    The coordinates of a section of two coefficients are ``a1 + a2`` and ``-a2``.
    """

    factor: Signal
    own: int


def linearise(signals: Signals, fit: Fit) -> list[OutputFactor]:
    """Return the factors of every output at a fit."""
    return [
        OutputFactor(
            _factor(signals, fit.structure, output, coefficients, states, derivatives=True)[0],
            coefficients.size + fit.structure.noise[output].size,
        )
        for output, (coefficients, states) in enumerate(zip(fit.coefficients, fit.states, strict=True))
    ]


class _Step(NamedTuple):
    """Changes of the poles and of the noise of every output, and the deviance that they lead to if linear."""

    poles: Signal
    noise: list[Signal]
    deviance: float


def _find_step(signals: Signals, fit: Fit) -> _Step:
    """Return the Gauss-Newton step."""
    factors, free = linearise(signals, fit), fit.structure.free
    deviations = np.sqrt(np.maximum(fit.squares / fit.counts, np.finfo(float).tiny))
    shared = np.vstack(
        [each.factor[each.own :, each.own :] / s for each, s in zip(factors, deviations, strict=True)]
    )
    poles = solve(shared[:, :free], shared[:, free]).values
    noise, squares = [], []
    for each, before in zip(factors, fit.structure.noise, strict=True):
        moment = each.factor[:, -1] - each.factor[:, each.own : -1] @ poles
        own = solve(each.factor[: each.own, : each.own], moment[: each.own])
        noise.append(own.values[each.own - before.size :].reshape(before.shape))
        squares.append(own.squares + float(moment[each.own :] @ moment[each.own :]))
    return _Step(poles, noise, fit.measure_deviance(np.array(squares)))


def _take_step(signals: Signals, fit: Fit, step: _Step) -> Fit | None:
    """Return the fit after the longest step that reduces the deviance; None if there is none."""
    structure = fit.structure
    for halving in range(_MAX_HALVINGS):
        scale = 0.5**halving
        sections = _join_neighbours(move(structure.sections, scale * step.poles))
        noise = tuple([old + scale * new for old, new in zip(structure.noise, step.noise, strict=True)])
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


def is_invertible(noise: Signal, samples: int) -> bool:
    """Return whether the zeros of the noise are inside of the unit circle, as far as a record can show."""
    return not noise.size or bool(np.abs(np.roots([1.0, *noise[1]])).max() <= limit_zeros(samples))


def minimise(signals: Signals, fit: Fit, steps: int, least: float = 1e-3, goal: float = float("inf")) -> Fit:
    """Return the fit after steps that each reduce the deviance by at least a given amount.

    They end where a deviance is out of reach, for which a step would need twice its expected reduction.
    """
    for _ in range(steps):
        step = _find_step(signals, fit)
        expected = fit.deviance - step.deviance
        if expected < min(least, _NEGLIGIBLE) or fit.deviance - 2.0 * expected > goal:
            break
        found = _take_step(signals, fit, step)
        if found is None:
            break
        gain, fit = fit.deviance - found.deviance, found
        if gain < least:
            break
    return fit
