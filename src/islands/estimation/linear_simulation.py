"""Simulation of a linear difference equation with estimated initial states, and the minimum of its error.

The simulated output is

    A(q) x(k) = B_1(q) u_1(k) + ... + constant + initial state,    y(k) = x(k) + e(k)

It is linear in everything except A, so that the other coefficients are eliminated (variable projection: Golub
and Pereyra 1973, with the Jacobian of Kaufman 1975). The iteration of Steiglitz and McBride (1965), which is
consistent under white measurement noise, gives the initial A; Gauss-Newton steps follow (Ljung 1999, sections
7.5 and 10.2).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.estimation.extended_least_squares import is_stable
from islands.expressions.tree import Constant, Expression
from islands.kernels.linear_filter import divide_rows
from islands.kernels.qr import orthogonalise
from islands.kernels.summation import dot

#: Iterations of Steiglitz and McBride, Gauss-Newton steps, and halvings of a step.
_INITIAL_ITERATIONS, _MAX_STEPS, _MAX_HALVINGS = 8, 30, 12

#: Largest magnitude of a pole: an integrator is estimated with an error.
_LARGEST_POLE = 1.0 + 1e-3

#: A column that keeps a smaller fraction of its norm depends on those before it.
_DEPENDENT = 1e-11

#: Samples for each parameter, initial states included, that an estimate needs.
_SAMPLES_PER_PARAMETER = 5


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """Rows of a model of a given order.

    Attributes
    ----------
    order : int
    terms : tuple of Expression
        The past outputs, then the terms whose values are the columns.
    columns : ndarray, shape (columns, rows)
        Values of the terms with inputs and of the constant.
    y : ndarray, shape (rows,)
    ends : ndarray of int64, shape (segments,)
        Row after the last one of every segment.
    """

    order: int
    terms: tuple[Expression, ...]
    columns: NDArray[np.float64]
    y: NDArray[np.float64]
    ends: NDArray[np.int64]

    def lag(self, series: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a series one to ``order`` rows later, with zeros at the start of every segment."""
        lagged = np.zeros((self.order, series.size))
        for begin, end in self.bounds:
            for row in range(min(self.order, end - begin - 1)):
                lagged[row, begin + row + 1 : end] = series[begin : end - row - 1]
        return lagged

    def divide(self, denominator: NDArray[np.float64], series: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the responses to the initial states, ``order`` of every segment, and series divided by A."""
        longest = max(self.lengths)
        pulse = np.zeros((1, longest))
        pulse[0, 0] = 1.0
        (response,) = divide_rows(denominator, pulse, np.array([longest]))
        divided = np.zeros((self.states + len(series), self.y.size))
        for segment, (begin, end) in enumerate(self.bounds):
            for row in range(self.order):
                divided[segment * self.order + row, begin + row : end] = response[: end - begin - row]
        divided[self.states :] = divide_rows(denominator, series, self.ends)
        return divided

    def with_constant(self) -> "LinearProblem":
        """Return the problem with a constant; the problem itself if it has one."""
        if self.has_constant:
            return self
        columns = np.vstack([self.columns, np.ones(self.y.size)])
        return replace(self, terms=(*self.terms, Constant(1.0)), columns=columns)

    @property
    def has_constant(self) -> bool:
        """Whether the last term is a constant."""
        return isinstance(self.terms[-1], Constant)

    @property
    def is_determined(self) -> bool:
        """Whether there are enough rows for the parameters and the initial states."""
        return self.y.size >= _SAMPLES_PER_PARAMETER * (len(self.terms) + self.states)

    @property
    def bounds(self) -> list[tuple[int, int]]:
        """First row of every segment, and the row after its last one."""
        ends = self.ends.tolist()
        return list(zip([0, *ends[:-1]], ends, strict=True))

    @property
    def lengths(self) -> list[int]:
        """Number of rows of every segment."""
        return [end - begin for begin, end in self.bounds]

    @property
    def states(self) -> int:
        """Number of initial states."""
        return self.order * self.ends.size


@dataclass(frozen=True, slots=True, eq=False)
class LinearSimulation:
    """Simulation for a given A with the best other coefficients.

    Attributes
    ----------
    problem : LinearProblem
    denominator : ndarray, shape (order,)
        Coefficients of A after the leading 1.
    basis : ndarray, shape (columns, rows)
        Orthonormal basis of the initial states and the columns, divided by A.
    triangle : ndarray, shape (columns, columns)
        The initial states and the columns, divided by A, in this basis.
    coefficients : ndarray, shape (columns,)
        Initial states and coefficients of the columns.
    residual : ndarray, shape (rows,)
    squares : float
        Sum of squares of the residual.
    """

    problem: LinearProblem
    denominator: NDArray[np.float64]
    basis: NDArray[np.float64]
    triangle: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    residual: NDArray[np.float64]
    squares: float


def find_start(problem: LinearProblem) -> LinearSimulation | None:
    """Return the best solution of the iteration of Steiglitz and McBride, which begins with least squares."""
    # With an offset that the initial states and the constant take, the divided output remains small.
    y, ones = problem.y - problem.y[0], np.ones((1, problem.y.size))
    series = np.vstack([problem.columns, y] if problem.has_constant else [problem.columns, ones, y])
    denominator: NDArray[np.float64] = np.zeros(problem.order)
    best: LinearSimulation | None = None
    for _ in range(_INITIAL_ITERATIONS):
        rows = problem.divide(denominator, series)
        solved = project(np.vstack([rows[:-1], -problem.lag(rows[-1])]), rows[-1])
        if solved is None or not np.isfinite(solved).all():
            break
        denominator = _reflect(solved[-problem.order :])
        found = solve(problem, denominator)
        if found is not None and (best is None or found.squares < best.squares):
            best = found
    return best


def minimise(found: LinearSimulation, least_gain: float) -> LinearSimulation:
    """Return the model with the least error that Gauss-Newton steps find, up to a relative gain of a step."""
    for _ in range(_MAX_STEPS):
        order, before = found.denominator.size, found.squares
        solved = project(np.vstack([found.basis, differentiate(found)]), found.residual)
        if solved is None:
            break
        step = solved[-order:]
        for _ in range(_MAX_HALVINGS):
            moved = solve(found.problem, found.denominator + step)
            if moved is not None and moved.squares < before:
                found = moved
                break
            step = step / 2.0
        if not found.squares < (1.0 - least_gain) * before:
            break
    return found


def solve(problem: LinearProblem, denominator: NDArray[np.float64]) -> LinearSimulation | None:
    """Return the simulation for A with the best other coefficients; None if A is unstable."""
    if not is_stable(denominator / _LARGEST_POLE ** np.arange(1, denominator.size + 1)):
        return None
    basis = problem.divide(denominator, problem.columns)
    factored = factor(basis, problem.y)
    if factored is None:
        return None
    residual = factored.residual
    squares = float(dot(residual, 0, residual, 0, residual.size))
    if not np.isfinite(squares):
        return None
    return LinearSimulation(
        problem, denominator, basis, factored.triangle, factored.coefficients, residual, squares
    )


def differentiate(found: LinearSimulation) -> NDArray[np.float64]:
    """Return the derivatives of the simulation with respect to A, shape (order, rows)."""
    problem = found.problem
    # The simulation is what the residual leaves of the output.
    lagged = problem.lag(problem.y - found.residual)
    slopes: NDArray[np.float64] = -divide_rows(found.denominator, lagged, problem.ends)
    return slopes


class _Factors(NamedTuple):
    """Factors of columns A = Q R, without Q."""

    triangle: NDArray[np.float64]
    projection: NDArray[np.float64]
    residual: NDArray[np.float64]

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients of least squares."""
        found: NDArray[np.float64] = scipy.linalg.solve_triangular(self.triangle, self.projection)
        return found


def factor(columns: NDArray[np.float64], target: NDArray[np.float64]) -> _Factors | None:
    """Orthogonalise columns in place; return None if one depends on those before it."""
    count, residual = len(columns), np.array(target)
    triangle, projection = np.empty((count, count)), np.empty(count)
    if orthogonalise(columns, residual, triangle, projection, _DEPENDENT) >= 0:
        return None
    return _Factors(triangle, projection, residual)


def project(columns: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the coefficients of least squares; None if a column depends on those before it.

    The columns are overwritten.
    """
    factored = factor(columns, target)
    return factored.coefficients if factored else None


def _reflect(denominator: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return A with unstable poles mirrored at the unit circle."""
    if is_stable(denominator):
        return denominator
    poles = np.roots(np.append(1.0, denominator))
    outside = np.abs(poles) > 1.0
    poles[outside] = 1.0 / poles[outside].conj()
    reflected: NDArray[np.float64] = np.real(np.poly(poles))[1:]
    return reflected
