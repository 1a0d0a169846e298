"""Block bootstrap of the parameters of a model, by one Gauss-Newton step per replicate.

The rows of the residual are cut into blocks, and each replicate weights the blocks at random (Rubin, Ann.
Statist. 9 (1981) 130-134, on blocks as in Carlstein, Ann. Statist. 14 (1986) 1171-1179). A block keeps the
correlation of the rows inside it, so the residual need not be white. The weights are exponential and
positive: a replicate never lacks the excitation of a rare block, as resampling with replacement may.

With the sums ``J'J`` and ``J'r`` of every block, a replicate costs one small linear system. The step is exact
for least squares, which is linear in the parameters, and of first order for refined parameters.

A state space has directions in which its parameters have no effect or hardly any: changes of the coordinates
of the states. Noise moves the parameters far along them, beyond the validity of a step of first order.
Replicates without steps along the directions of the least information remain close (truncation of the
eigenvalues: Hansen, SIAM (1998), ch. 3).
"""

from collections.abc import Iterator
from itertools import pairwise
from math import isqrt

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from islands.estimation.constraints.conditions import Constrained
from islands.estimation.constraints.state_space import linearise_constraints, meet_constraints
from islands.estimation.damped_least_squares import find_directions, inner_products
from islands.estimation.parameter_constraints import constrain_model
from islands.estimation.shooting_residual import make_residual
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.records.coupled import AnyRecord
from islands.simulation.initial_outputs import estimate_initial_outputs
from islands.simulation.outcome import EvaluationOutcome

#: Parts of the largest information below which a direction is left out, one after the other.
_LEAST_INFORMATION = tuple(10.0**power for power in range(-8, -2))


def draw_parameters(
    model: AnyModel,
    record: AnyRecord,
    interval: int | None,
    constraints: str,
    warm_up: int | None,
    draws: int,
    rng: Generator,
) -> Iterator[NDArray[np.float64]]:
    """Yield draws of parameters from their block-bootstrap distribution, each time in fewer directions.

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

    Yields
    ------
    ndarray, shape (kept, terms)
        First steps in all directions, then without the directions whose information is below a growing part
        of the largest. Draws with a sign that the constraints exclude are left out; if all have one, the
        parameters of the model are the only draw. The draws are equal to the parameters of the model if the
        constraints leave no direction free, or if the residual diverges or is not finite.
    """
    theta = np.array(model.parameters)
    repeated = np.tile(theta, (draws, 1))
    constrained: Constrained | EvaluationOutcome
    if isinstance(model, LatentModel):
        constrained = linearise_constraints(model, constraints)
    else:
        constrained = constrain_model(model, constraints)
    if isinstance(constrained, EvaluationOutcome):
        yield repeated
        return
    directions = find_directions(theta, constrained)
    if isinstance(directions, EvaluationOutcome) or not directions.shape[1]:
        yield repeated
        return
    if interval is None:
        record = estimate_initial_outputs(model, record, warm_up)
    residual = make_residual(model, record, interval, warm_up)
    error = residual(theta)
    if error is None or not np.isfinite(error).all():
        yield repeated
        return
    normal, gradient = _block_sums(residual.differentiate(theta, directions), error)
    # The parameters are a minimum up to the tolerance of the refinement: replicates scatter about them.
    gradient -= np.add.reduce(gradient) / len(gradient)
    weights = rng.standard_exponential((draws, len(normal)))
    for basis in _list_bases(np.add.reduce(normal)):
        steps = np.array([_solve(normal, gradient, each, basis) for each in weights])
        drawn = repeated - np.einsum("tf,df->dt", directions, steps)
        if isinstance(model, LatentModel):
            drawn = meet_constraints(model, drawn, constraints)
        signed = [draw for draw in drawn if constrained.has_signs(draw)]
        yield np.array(signed or [theta])


def _list_bases(information: NDArray[np.float64]) -> Iterator[NDArray[np.float64] | None]:
    """Yield the directions of the steps as columns, without those of the least information; None for all."""
    yield None
    scale = np.sqrt(np.where(np.diag(information) > 0.0, np.diag(information), 1.0))
    values, vectors = np.linalg.eigh(information / scale / scale[:, None])
    kept = len(values)
    for least in _LEAST_INFORMATION:
        informative = values > least * values[-1]
        count = int(np.count_nonzero(informative))
        if 0 < count < kept:
            kept = count
            yield vectors[:, informative] / scale[:, None]


def _solve(
    normal: NDArray[np.float64],
    gradient: NDArray[np.float64],
    weights: NDArray[np.float64],
    basis: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Return the step of a replicate, which weights the blocks, along the columns of a basis."""
    left = np.add.reduce(weights[:, None, None] * normal)
    right = np.add.reduce(weights[:, None] * gradient)
    if basis is not None:
        # One product after the other: the sum over all operands at once takes the fourth power of the size.
        left = np.einsum("fi,fj->ij", basis, np.einsum("fg,gj->fj", left, basis))
        right = np.einsum("fi,f->i", basis, right)
    scale = np.sqrt(np.where(np.diag(left) > 0.0, np.diag(left), 1.0))
    step: NDArray[np.float64]
    step = np.linalg.lstsq(left / scale / scale[:, None], right / scale, rcond=None)[0] / scale
    return step if basis is None else np.einsum("fi,i->f", basis, step)


def _block_sums(
    jacobian: NDArray[np.float64], error: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return J'J and J'r of every block, of shapes (blocks, free, free) and (blocks, free)."""
    # About as many blocks as rows in a block: enough replicable blocks, and blocks longer than the memory of
    # most residuals.
    cuts = np.linspace(0, error.size, max(2, isqrt(error.size)) + 1).astype(int)
    sums = [inner_products(jacobian, error, int(first), int(last)) for first, last in pairwise(cuts)]
    return np.array([each for each, _ in sums]), np.array([each for _, each in sums])
