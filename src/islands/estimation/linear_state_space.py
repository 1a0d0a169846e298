"""Linear state spaces of the least error of the free run, which are the starts of models with units.

The difference equation of `linear_simulation` is written in the observer form and balanced: its states are
then shown by the output as much as the input reaches them (Moore, IEEE Trans. Autom. Control 26 (1981)
17-32). Entries of very different magnitudes would slow the estimation.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.estimation.linear_simulation import LinearProblem, find_start, minimise
from islands.expressions.tree import Lagged
from islands.kernels.state_space import simulate_states
from islands.models.latent import StateSpaceLayout
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset

#: The steps end when one reduces the squared error by a smaller relative amount.
_LEAST_GAIN = 1e-6

#: Segments that are used, at most: the longest ones, because each has an initial state.
_LARGEST_SEGMENTS = 16

#: Largest magnitude of a pole in the Gramians, which an integrator does not have.
_LARGEST_POLE = 0.9995

#: Eigenvalues of a Gramian below this fraction of the largest are replaced by it.
_LEAST_EIGENVALUE = 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class LinearStateSpace:
    """Matrices of ``x(k+1) = A x(k) + B u(k)``, ``y(k) = C x(k) + D u(k) + level``.

    Attributes
    ----------
    a, b, c, d : ndarray, shapes (states, states), (states, inputs), (states,) and (inputs,)
    level : float
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    c: NDArray[np.float64]
    d: NDArray[np.float64]
    level: float

    @property
    def layout(self) -> StateSpaceLayout:
        """Sizes without units."""
        return StateSpaceLayout(len(self.a), len(self.d), 0)

    @property
    def theta(self) -> NDArray[np.float64]:
        """Parameters in the order of the kernel."""
        drift = np.zeros(len(self.a))
        return np.concatenate([self.a.ravel(), self.b.ravel(), self.c, self.d, drift, [self.level]])


def fit_linear_state_space(record: Dataset, order: int) -> LinearStateSpace | None:
    """Fit a linear state space whose states have the standard deviation 1.

    Parameters
    ----------
    record : Dataset
        Record without missing values.
    order : int
        Number of states. The output reads the inputs that are read one sample early, also at sample k.

    Returns
    -------
    LinearStateSpace or None
        None if the record is too short, or without a stable model.
    """
    problem = _make_problem(record, order)
    if problem is None:
        return None
    problem = problem.with_constant()
    start = find_start(problem) if problem.is_determined else None
    if start is None:
        return None
    minimum = minimise(start, _LEAST_GAIN)
    poles, coefficients = minimum.denominator, minimum.coefficients[problem.states :]
    a = np.diag(np.ones(order - 1), 1)
    a[:, 0] = -poles
    b, d, at = np.zeros((order, record.inputs)), np.zeros(record.inputs), 0
    for place, name in enumerate(record.input_names):
        if parse_channel_name(name).at_once:
            d[place] = coefficients[at]
            at += 1
        b[:, place] = coefficients[at : at + order] - d[place] * poles
        at += order
    gain = 1.0 + poles.sum()
    level = float(coefficients[at] / gain) if gain else 0.0
    found = _balance(a, b, np.eye(order)[0])
    return _normalise(LinearStateSpace(*found, d, level), record)


def _make_problem(record: Dataset, order: int) -> LinearProblem | None:
    """Return the rows of a model without a constant; None if no segment is long enough.

    It reads ``order`` samples of an input, and one more of an input that is read one sample early.
    """
    read = [
        (place, lag)
        for place, name in enumerate(record.input_names)
        for lag in range(1, order + 1 + parse_channel_name(name).at_once)
    ]
    first = max([order, *(lag for _, lag in read)])
    longest = sorted(record.bounds, key=lambda bounds: bounds[0] - bounds[1])[:_LARGEST_SEGMENTS]
    kept = sorted((begin, end) for begin, end in longest if end - begin > first + order)
    if not kept:
        return None
    ends = np.cumsum([end - begin - first for begin, end in kept], dtype=np.int64)
    terms = [Lagged(0, lag) for lag in range(1, order + 1)]
    terms += [Lagged(1 + place, lag) for place, lag in read]
    columns = [
        np.concatenate([record.u[begin + first - lag : end - lag, place] for begin, end in kept])
        for place, lag in read
    ]
    y = np.concatenate([record.y[begin + first : end] for begin, end in kept])
    return LinearProblem(order, tuple(terms), np.array(columns), y, ends)


def _balance(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the balanced form; poles outside of the unit circle count as slow ones."""
    radius = float(np.abs(np.linalg.eigvals(a)).max())
    stable = a * min(1.0, _LARGEST_POLE / max(radius, _LARGEST_POLE))
    reached = scipy.linalg.solve_discrete_lyapunov(stable, b @ b.T, method="bilinear")
    shown = scipy.linalg.solve_discrete_lyapunov(stable.T, np.outer(c, c), method="bilinear")
    values, vectors = np.linalg.eigh((reached + reached.T) / 2.0)
    if not values.max() > 0.0:
        return a, b, c
    root = vectors * np.sqrt(np.maximum(values, _LEAST_EIGENVALUE * values.max()))
    left, squares, _ = np.linalg.svd(root.T @ shown @ root)
    squares = np.maximum(squares, np.finfo(float).tiny)
    forward = root @ left / squares**0.25
    backward = np.linalg.inv(forward)
    return backward @ a @ forward, backward @ b, c @ forward


def _normalise(model: LinearStateSpace, record: Dataset) -> LinearStateSpace | None:
    """Return the model with states of the standard deviation 1 for the inputs of a record."""
    # An input that is read one sample early only shifts the states.
    first, none = record.samples // 10, np.zeros(0, np.int64)
    by = measure_deviations(model.theta, none, record.u, np.zeros(len(model.a)), first)
    if by is None:
        return None
    return LinearStateSpace(
        model.a * by / by[:, None], model.b / by[:, None], model.c * by, model.d, model.level
    )


def measure_deviations(
    theta: NDArray[np.float64],
    codes: NDArray[np.int64],
    u: NDArray[np.float64],
    start: NDArray[np.float64],
    first: int = 0,
) -> NDArray[np.float64] | None:
    """Return the standard deviation of each state for an input, 1 of a state that does not move.

    Parameters
    ----------
    theta : ndarray, shape (parameters,)
        Parameters in the order of the kernel.
    codes : ndarray of int64, shape (units,)
    u : ndarray, shape (rows, inputs)
    start : ndarray, shape (states,)
        States at the first row.
    first : int
        First row that counts.

    Returns
    -------
    ndarray, shape (states,), or None
        None after a divergence.
    """
    states = np.empty((len(u), len(start)))
    if simulate_states(theta, codes, u, start, states) < len(u):
        return None
    found = states[first:].std(axis=0)
    return np.where(found > 0.0, found, 1.0)
