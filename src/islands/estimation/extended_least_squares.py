"""Extended least squares: least squares with a model of coloured noise (a NARMAX model).

Least squares is biased if the equation error is coloured and the model reads past outputs, because the past
outputs then correlate with the error. Extended least squares adds noise terms,

    y(k) = psi(k) theta + c_1 e(k-1) + ... + c_n e(k-n) + e(k),

until e is white (Chen and Billings 1989). The noise terms are estimated with theta and left out of the final
model. The first iteration takes the residuals of least squares for e. The following ones filter the columns
by 1/C(q), C = 1 + c_1 q^-1 + ..., so that they converge to the minimum of the prediction error, also where
the unfiltered iteration diverges (Ljung 1999, sections 10.3 and 11.5).
"""

from dataclasses import dataclass
from math import log

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.estimation.constrained_least_squares import constrained_least_squares, null_space
from islands.estimation.covariance import sandwich_of_jacobian
from islands.estimation.least_squares import DEPENDENT, Estimate, combine
from islands.kernels.qr import orthogonalise
from islands.kernels.summation import dot
from islands.simulation.outcome import OK, EvaluationOutcome

#: Numbers of noise terms among which the information criterion of Akaike selects.
_ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32)

#: The selection ends after this number of orders without a smaller criterion; the final estimate has the last
#: of them. At the selected order, the moving average that approximates an autoregressive noise still shifts
#: the parameters by a fraction of their standard errors.
_PATIENCE = 2

#: Rows of the record that each noise term requires.
_ROWS_PER_TERM = 20

#: The iteration ends when it reduces the squared error by a smaller relative amount.
_MIN_GAIN = 1e-9

#: Maximum numbers of iterations for the selection of the order and for the final estimate.
_SELECTING_ITERATIONS, _MAX_ITERATIONS = 5, 30

#: Maximum number of halvings of a step that increases the error.
_MAX_HALVINGS = 12

#: A residual with a smaller norm relative to the output is rounding error.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedEstimate:
    """Parameters of the deterministic terms, and the coefficients c_1, ..., c_n of the noise terms."""

    estimate: Estimate
    noise: tuple[float, ...]


def extended_least_squares(
    psi: NDArray[np.float64],
    y: NDArray[np.float64],
    S: NDArray[np.float64],
    c: NDArray[np.float64],
    segments: NDArray[np.int64],
) -> ExtendedEstimate | EvaluationOutcome:
    """Estimate parameters under ``S theta = c`` and coloured noise.

    Akaike's criterion selects the number of noise terms, and the final estimate has about twice that number,
    so that the bias of a noise model that is too short is small against the standard errors.

    Parameters
    ----------
    psi : ndarray, shape (terms, rows)
        The regressor matrix, transposed.
    y : ndarray, shape (rows,)
        The target.
    S, c : ndarray, shape (constraints, terms) and (constraints,)
        Constraints, as in `constrained_least_squares`.
    segments : ndarray of int64, shape (segments,)
        Number of rows of each recording. Noise does not continue from one recording to the next.

    Returns
    -------
    ExtendedEstimate or EvaluationOutcome
        The outcome of `constrained_least_squares` after a failure. The residual variance is that of e.
    """
    start = constrained_least_squares(psi, y, S, c)
    if not start.outcome:
        return start.outcome
    scale = np.sqrt(np.array([dot(row, 0, row, 0, row.size) for row in np.ascontiguousarray(psi)]))
    found = null_space(S / scale, c)
    if isinstance(found, EvaluationOutcome):
        return found
    particular, basis = found
    free, rows = basis.shape[1], y.size
    if not free:
        return ExtendedEstimate(start, ())
    columns = psi / scale[:, None]
    target = y - combine(particular[:, None], columns)[0]
    regression = _NoiseRegression(combine(basis, columns), target, np.cumsum(segments))
    eta = basis.T @ (start.theta * scale - particular)
    noise = _select_noise(regression, eta, rows, _ROUNDING**2 * dot(y, 0, y, 0, rows))
    if noise is None:
        return ExtendedEstimate(start, ())
    sensitivities, error = regression(noise)
    covariance = sandwich_of_jacobian(sensitivities, error)[:free, :free]
    variances = np.einsum("ti,ij,tj->t", basis, covariance, basis)
    estimate = Estimate(
        (particular + basis @ noise[:free]) / scale,
        np.sqrt(np.maximum(variances, 0.0)) / scale,
        dot(error, 0, error, 0, rows) / (rows - noise.size),
        OK,
    )
    return ExtendedEstimate(estimate, tuple(noise[free:].tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class _NoiseRegression:
    """Prediction error e and its sensitivities as functions of eta and the noise coefficients.

    Attributes
    ----------
    columns : ndarray, shape (free, rows)
    target : ndarray, shape (rows,)
    ends : ndarray of int64, shape (segments,)
        Row after the last one of every segment.
    """

    columns: NDArray[np.float64]
    target: NDArray[np.float64]
    ends: NDArray[np.int64]

    def __call__(self, parameters: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the sensitivities of the prediction, shape (parameters, rows), and e."""
        free = len(self.columns)
        eta, noise = parameters[:free], parameters[free:]
        sensitivities = np.zeros((parameters.size, self.target.size))
        sensitivities[:free] = self._filter(self.columns, noise)
        error = self._filter(self.target, noise) - combine(eta[:, None], sensitivities[:free])[0]
        filtered = self._filter(error, noise)
        for segment in self._segments:
            for lag in range(1, min(noise.size, segment.stop - segment.start - 1) + 1):
                delayed = filtered[segment.start : segment.stop - lag]
                sensitivities[free + lag - 1, segment.start + lag : segment.stop] = delayed
        return sensitivities, error

    def _filter(self, series: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """Divide series by C(q), from rest at the start of every segment."""
        # scipy.signal takes half a second to import, and only this estimator needs it.
        from scipy.signal import lfilter  # noqa: PLC0415

        polynomial = np.append(1.0, noise)
        parts = [lfilter([1.0], polynomial, series[..., segment]) for segment in self._segments]
        filtered: NDArray[np.float64] = np.concatenate(parts, axis=-1)
        return filtered

    @property
    def _segments(self) -> list[slice]:
        return [
            slice(int(first), int(last))
            for first, last in zip(np.append(0, self.ends[:-1]), self.ends, strict=True)
        ]


def _select_noise(
    regression: _NoiseRegression, eta: NDArray[np.float64], rows: int, rounding: float
) -> NDArray[np.float64] | None:
    """Return eta and the noise coefficients, or None for a white or negligible residual."""
    fits = [eta]
    criteria: list[float] = []
    orders = [order for order in _ORDERS if order <= rows // _ROWS_PER_TERM]
    for order in orders:
        if order:
            padded = np.append(fits[-1], np.zeros(eta.size + order - fits[-1].size))
            fits.append(_minimise(regression, padded, _SELECTING_ITERATIONS, 0.1 / rows))
        error = regression(fits[-1])[1]
        squares = dot(error, 0, error, 0, rows)
        if not squares > rounding:
            return None
        criteria.append(rows * log(squares / rows) + 2 * order)
        best = int(np.argmin(criteria))
        if len(criteria) > best + _PATIENCE:
            break
    if not criteria or best == 0:
        return None
    return _minimise(regression, fits[min(best + _PATIENCE, len(fits) - 1)], _MAX_ITERATIONS, _MIN_GAIN)


def _minimise(
    regression: _NoiseRegression, parameters: NDArray[np.float64], iterations: int, least_gain: float
) -> NDArray[np.float64]:
    """Minimise the prediction error by Gauss-Newton steps from the given parameters."""
    sensitivities, error = regression(parameters)
    rows, count = error.size, parameters.size
    squares = dot(error, 0, error, 0, rows)
    for _ in range(iterations):
        triangle, projection = np.empty((count, count)), np.empty(count)
        if orthogonalise(sensitivities, error.copy(), triangle, projection, DEPENDENT) >= 0:
            break
        step = scipy.linalg.solve_triangular(triangle, projection)
        for _ in range(_MAX_HALVINGS):
            candidate = parameters + step
            step = step / 2.0
            if not is_stable(candidate[len(regression.columns) :]):
                continue
            sensitivities, error = regression(candidate)
            smaller = dot(error, 0, error, 0, rows)
            if smaller < squares:
                break
        else:
            break
        gain = 1.0 - smaller / squares
        parameters, squares = candidate, smaller
        if gain < least_gain:
            break
    return parameters


def is_stable(coefficients: NDArray[np.float64]) -> bool:
    """Return whether the roots of a polynomial lie inside the unit circle (the recursion of Schur and Cohn).

    Parameters
    ----------
    coefficients : ndarray, shape (order,)
        Coefficients of ``q^-1``, ``q^-2``, ... after the leading 1.
    """
    while coefficients.size:
        reflection = coefficients[-1]
        if not abs(reflection) < 1.0:
            return False
        rest = coefficients[:-1]
        coefficients = (rest - reflection * rest[::-1]) / (1.0 - reflection**2)
    return True
