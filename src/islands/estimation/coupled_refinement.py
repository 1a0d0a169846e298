"""Joint refinement of all equations of a coupled model on the error of their common simulation.

Each equation is estimated with the measured values of the other outputs. Their noise biases the parameters,
and the coupled simulation feeds errors from one equation to the other. The refinement minimises the error of
the simulation that the model is used for.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from islands.data.coupled_record import CoupledRecord
from islands.estimation.damped_least_squares import Residual, find_directions, minimise
from islands.estimation.parameter_constraints import constrain_model
from islands.models.coupled_narx import CoupledModel
from islands.simulation.coupled_free_run import CoupledSimulator
from islands.simulation.outcome import EvaluationOutcome

#: Refinement ends when a step reduces the squared error by a smaller relative amount.
_MIN_GAIN = 1e-6


def refine_coupled(
    model: CoupledModel,
    record: CoupledRecord,
    interval: int | None,
    warm_up: int,
    constraints: str = "none",
    max_steps: int = 20,
    stop: Callable[[], bool] = lambda: False,
) -> CoupledModel | None:
    """Refine the parameters of all equations on the simulation error of all outputs.

    The error of every output counts relative to its range.

    Parameters
    ----------
    model : CoupledModel
        Model with parameters that meet the constraints.
    record : CoupledRecord
        Estimation data with the sampling time of the model, without missing outputs.
    interval : int or None
        Length of a shooting interval in samples. None is the free run.
    warm_up : int
        Number of samples before the first prediction of every interval.
    constraints : str
        Constraints of every equation. The refined equations meet them.
    max_steps : int
        Maximum number of accepted steps.
    stop : callable
        Called before each step. Once it returns true, the refinement ends with the parameters so far.

    Returns
    -------
    CoupledModel or None
        None if the simulation of the model diverges, a constraint forces a parameter to zero, or no step
        reduces the error.
    """
    directions = _find_directions(model, constraints)
    residual = _CoupledResidual(model, record, interval, warm_up)
    theta = np.array(model.parameters)
    error = residual(theta)
    if directions is None or error is None:
        return None
    found = minimise(
        *(residual, theta, error, directions), max_steps=max_steps, min_gain=_MIN_GAIN, stop=stop
    )
    return model.with_parameters(found.theta.tolist()) if found.steps else None


class _CoupledResidual(Residual):
    """Simulation error of all outputs, each divided by its range, as a function of the parameters."""

    def __init__(
        self, model: CoupledModel, record: CoupledRecord, interval: int | None, warm_up: int
    ) -> None:
        self._simulate = CoupledSimulator(model, record, interval, warm_up)
        self._y = record.y
        self._scale = np.array([each.output_range or 1.0 for each in record.records])

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        simulated = self._simulate(theta)
        if not simulated.outcome:
            return None
        known = ~np.isnan(simulated.y[:, 0])
        return np.ascontiguousarray(((simulated.y - self._y)[known] / self._scale).T).reshape(-1)


def _find_directions(model: CoupledModel, constraints: str) -> NDArray[np.float64] | None:
    """Return the free directions of all parameters, shape (terms, free); None if a term is forced to zero."""
    directions: NDArray[np.float64] = np.zeros((model.size, 0))
    begin = 0
    for single in model.models:
        constrained = constrain_model(single, constraints)
        if isinstance(constrained, EvaluationOutcome):
            return None
        free = find_directions(np.array(single.parameters), constrained)
        if isinstance(free, EvaluationOutcome):
            return None
        block = np.zeros((model.size, free.shape[1]))
        block[begin : begin + single.size] = free
        directions = np.hstack([directions, block])
        begin += single.size
    return directions
