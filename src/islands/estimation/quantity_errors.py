"""Standard errors of the modes and of the static gains of latent models.

The parameters of a state space have no unique coordinates. The modes and the gains of its linear system at
rest do not depend on the coordinates, so that they have standard errors, by the delta method: the covariance
of the parameters, times the derivatives of a quantity on both sides. The covariance is the sandwich of the
free run with its coloured residual (see `covariance`), on the directions that have an effect on the free run
(a pseudo-inverse of the information). A change of the coordinates has none, neither on the free run nor on
the quantities.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.state_space import linearise_constraints
from islands.estimation.covariance import sandwich
from islands.estimation.damped_least_squares import inner_products
from islands.estimation.fitted_state_space import number
from islands.kernels.state_space import trace_states
from islands.kernels.state_space_products import accumulate_products
from islands.models.latent import LatentModel
from islands.models.state_space import Quantity, list_modes
from islands.records.dataset import Dataset
from islands.simulation.initial_states import estimate_initial_states, read_inputs
from islands.simulation.layout import find_intervals

#: Information of a direction, relative to the largest, up to which it has no effect: of changes of the
#: coordinates, it is the rounding error of the sums, 1e-17 to 1e-15.
_NO_EFFECT = 1e-13

#: Part of the derivatives of a quantity along the constraints up to which these determine it.
_DETERMINED = 1e-5

#: Step of a difference of parameters in units of their magnitudes.
_STEP = 1e-6


def with_quantity_errors(
    model: LatentModel, record: Dataset, warm_up: int | None = None, constraints: str = "none"
) -> LatentModel:
    """Return a model with the standard errors of its quantities.

    Parameters
    ----------
    model : LatentModel
        Model whose parameters minimise the error of the free run.
    record : Dataset
        Data of the estimation, with all outputs.
    warm_up : int or None
        Number of samples before the first prediction. None is the memory of the model.
    constraints : str
        Statements that the parameters meet. A quantity that they determine has the standard error 0.

    Returns
    -------
    LatentModel
        The model itself if the free run diverges, if it has no sampling time, if the record has no more
        samples than parameters, or if a quantity has no derivative, as at a double pole or of an integrator.
    """
    theta = np.array(model.parameters)
    found = _differentiate_errors(model, record, model.maximum_lag if warm_up is None else warm_up)
    if model.dt is None or found is None or found[1].size <= theta.size:
        return model
    slopes = _differentiate(model, theta)
    if slopes is None:
        return model
    jacobian, error = found
    unit = np.where(theta == 0.0, 1.0, np.abs(theta))
    jacobian *= unit[:, None]
    norms = np.sqrt(np.einsum("fk,fk->f", jacobian, jacobian))
    norms[norms == 0.0] = 1.0
    jacobian /= norms[:, None]
    # Sums in a written order have the same bits on every number of threads.
    information, scaled = inner_products(jacobian, error, 0, error.size)[0], slopes * (unit / norms)
    rows = linearise_constraints(model, constraints).S * (unit / norms)
    if len(rows):
        admissible = _find_admissible(rows)
        information = np.einsum("fa,fb->ab", admissible, np.einsum("fg,gb->fb", information, admissible))
    values, vectors = np.linalg.eigh(information)
    kept = values > _NO_EFFECT * values[-1]
    basis = vectors[:, kept] / np.sqrt(values[kept])
    if len(rows):
        basis = np.einsum("fa,ai->fi", admissible, basis)
        # The differences of a quantity that the constraints determine have no exact zero.
        left = np.linalg.norm(np.einsum("qf,fa->qa", scaled, admissible), axis=1)
        scaled[left <= _DETERMINED * np.linalg.norm(scaled, axis=1)] = 0.0
    # Effect of the residual of every row on a quantity, which no change of the coordinates alters.
    effects = np.einsum("qf,fi,gi->qg", scaled, basis, basis)
    influences = np.einsum("qg,gk->qk", effects, jacobian)
    variances = np.array([sandwich(each[None], error)[0, 0] for each in influences])
    variances *= (error.size - 1) / max(1, error.size - int(np.count_nonzero(kept)))
    # A dead time of whole samples is chosen, not estimated.
    variances[[each.name == "dead time" for each in model.quantities]] = np.nan
    return replace(model, quantity_errors=tuple(np.sqrt(variances).tolist()))


def _differentiate_errors(
    model: LatentModel, record: Dataset, warm_up: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the derivatives and the errors of the free run of each segment; None if it diverges.

    Returns
    -------
    ndarray, shape (parameters, samples)
    ndarray, shape (samples,)
    """
    places, columns = number(np.isin(model.layout.names, model.wiring)), len(model.wiring)
    starts, lengths = find_intervals(record, warm_up, None)
    states = estimate_initial_states(model, record, starts, warm_up)
    products = np.empty((columns + model.order + 1,) * 2)
    found = []
    for first, length, start in zip(starts.tolist(), lengths.tolist(), states, strict=True):
        # The states are those at the last sample before the prediction, the output of which is no error.
        begin, end = first - 1 - max(model.input_lags), first + length
        u, _ = read_inputs(record, model, begin, end)
        y = np.append(np.nan, record.y[first:end])
        rows = np.zeros((len(products), len(y)))
        u, units = np.ascontiguousarray(u), len(model.codes)
        traces = np.empty((len(y), model.order + 2 * units, 1))
        if trace_states(model.theta, model.codes, u, start, traces) < len(y):
            return None
        signals = traces, 0, u, y, *model.limits.range
        accumulate_products(model.theta, places, units, *signals, columns, products, rows)
        if not np.isfinite(rows).all():
            return None
        found.append(rows[:, 1:])
    joined = np.concatenate(found, axis=1)
    return joined[:columns], joined[-1]


def _find_admissible(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of the directions along which linearised constraints hold, as columns."""
    return np.asarray(np.linalg.svd(rows)[2][len(rows) :].T, np.float64)


def _differentiate(model: LatentModel, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the derivatives of the quantities, shape (quantities, parameters); None if there are none."""
    poles = list_modes(model.linearise().poles)
    names = [each.name for each in model.quantities]
    slopes = np.empty((len(names), theta.size))
    for place, value in enumerate(theta):
        step = _STEP * (abs(value) or 1.0)
        found = []
        for sign in (1.0, -1.0):
            moved = theta.copy()
            moved[place] += sign * step
            found.append(_measure(model.with_parameters(moved.tolist()), poles))
        # A double pole becomes a resonance or two time constants, which are as many quantities.
        if any([each.name for each in side] != names for side in found):
            return None
        above, below = (np.array([each.value for each in side]) for side in found)
        slopes[:, place] = (above - below) / (2.0 * step)
    return slopes if np.isfinite(slopes).all() else None


def _measure(model: LatentModel, poles: Sequence[complex]) -> list[Quantity]:
    """Return the quantities of a model, with its modes in the order of the nearest of the given poles."""
    system = model.linearise()
    left, ordered = list_modes(system.poles), []
    for pole in poles[: len(left)]:
        nearest = min(left, key=lambda each: abs(each - pole))
        left.remove(nearest)
        ordered.append(nearest)
    return list(system.list_quantities(ordered))
