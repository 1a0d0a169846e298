"""Block bootstrap of the parameters of a model, by one Gauss-Newton step per replicate.

The rows of the residual are cut into blocks, and each replicate weights the blocks at random (Rubin, Ann.
Statist. 9 (1981) 130-134, on blocks as in Carlstein, Ann. Statist. 14 (1986) 1171-1179). A block keeps the
correlation of the rows inside it, so the residual need not be white. The weights are exponential and
positive: a replicate never lacks the excitation of a rare block, as resampling with replacement may.

With the sums ``J'J`` and ``J'r`` of every block, a replicate costs one small linear system. The step is exact
for least squares, which is linear in the parameters, and of first order for refined parameters.
"""

from itertools import pairwise
from math import isqrt

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from islands.data.coupled_record import AnyRecord
from islands.estimation.damped_least_squares import find_directions, inner_products
from islands.estimation.parameter_constraints import constrain_model
from islands.estimation.shooting_residual import make_residual
from islands.models.coupled_narx import AnyModel
from islands.simulation.initial_outputs import estimate_initial_outputs
from islands.simulation.outcome import EvaluationOutcome


def draw_parameters(
    model: AnyModel,
    record: AnyRecord,
    interval: int | None,
    constraints: str,
    warm_up: int | None,
    draws: int,
    rng: Generator,
) -> NDArray[np.float64]:
    """Draw parameters of a model from their block-bootstrap distribution.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model whose parameters minimise the multiple-shooting error.
    record : Dataset or CoupledRecord
        Estimation data.
    interval : int or None
        Shooting interval of that error in samples: 1 for least squares, None for the free run.
    constraints : str
        Statements of ``constraint``. Every draw meets them as exactly as the model does.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.
    draws : int
        Number of draws.
    rng : Generator

    Returns
    -------
    ndarray, shape (kept, terms)
        Draws with a sign that the constraints exclude are left out; if all have one, the parameters of the
        model are the only draw. The draws are equal to the parameters of the model if the constraints leave
        no direction free, or if the residual diverges or is not finite.
    """
    theta = np.array(model.parameters)
    repeated = np.tile(theta, (draws, 1))
    constrained = constrain_model(model, constraints)
    if isinstance(constrained, EvaluationOutcome):
        return repeated
    directions = find_directions(theta, constrained)
    if isinstance(directions, EvaluationOutcome) or not directions.shape[1]:
        return repeated
    if interval is None:
        record = estimate_initial_outputs(model, record, warm_up)
    residual = make_residual(model, record, interval, warm_up)
    error = residual(theta)
    if error is None or not np.isfinite(error).all():
        return repeated
    normal, gradient = _block_sums(residual.differentiate(theta, directions), error)
    # The parameters are a minimum up to the tolerance of the refinement: replicates scatter about them.
    gradient -= np.add.reduce(gradient) / len(gradient)
    for index in range(draws):
        weights = rng.standard_exponential(len(normal))
        left = np.add.reduce(weights[:, None, None] * normal)
        scale = np.sqrt(np.where(np.diag(left) > 0.0, np.diag(left), 1.0))
        right = np.add.reduce(weights[:, None] * gradient)
        step = np.linalg.lstsq(left / scale / scale[:, None], right / scale, rcond=None)[0] / scale
        repeated[index] -= directions @ step
    signed = [draw for draw in repeated if constrained.has_signs(draw)]
    return np.array(signed or [theta])


def _block_sums(
    jacobian: NDArray[np.float64], error: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return J'J and J'r of every block, of shapes (blocks, free, free) and (blocks, free)."""
    # About as many blocks as rows in a block: enough replicable blocks, and blocks longer than the memory of
    # most residuals.
    cuts = np.linspace(0, error.size, max(2, isqrt(error.size)) + 1).astype(int)
    sums = [inner_products(jacobian, error, int(first), int(last)) for first, last in pairwise(cuts)]
    return np.array([each for each, _ in sums]), np.array([each for _, each in sums])
