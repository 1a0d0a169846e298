"""Refinement of parameters on the simulation error, within the null space of the constraints.

Least squares minimises the one-step-ahead error. Refinement minimises the multiple-shooting error. The
constraints remain satisfied because the steps are restricted to their null space.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.covariance import sandwich_of_jacobian
from islands.estimation.damped_least_squares import (
    Minimisation,
    find_directions,
    mean_square,
    scale_parameters,
)
from islands.estimation.parameter_constraints import constrain_model
from islands.estimation.shooting_residual import (
    BlockResidual,
    FreeRunResidual,
    ShootingResidual,
    make_free_run_residual,
    make_residual,
)
from islands.expressions.tree import Constant, Lagged
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.records.compatibility import match_record
from islands.records.coupled import AnyRecord, CoupledRecord, match_coupled
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.predictors import multiple_shooting

M = TypeVar("M", bound=AnyModel)

#: Refinement ends when a step reduces the squared error by a smaller relative amount.
_MIN_GAIN = 1e-8


@dataclass(frozen=True, slots=True)
class RefinedModel(Generic[M]):
    """A refined model, its mean squared error before and after, and the number of accepted steps.

    Changes of initial outputs count as errors, but not as samples.
    """

    model: M
    before: float
    after: float
    steps: int


class Refinement(Generic[M]):
    """Refinement of the parameters of a model that may be continued; `begin_refinement` begins one.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    residual : ShootingResidual or FreeRunResidual or BlockResidual
    minimisation : Minimisation
        Of the parameters, and of initial outputs after them.
    directions : ndarray, shape (values, free)
        Directions along which the constraints hold.
    """

    def __init__(
        self,
        model: M,
        residual: ShootingResidual | FreeRunResidual | BlockResidual,
        minimisation: Minimisation,
        directions: NDArray[np.float64],
    ) -> None:
        self._model, self._residual, self._directions = model, residual, directions
        self.minimisation = minimisation
        self._samples = minimisation.error.size - (len(directions) - len(model.parameters))

    @property
    def model(self) -> M:
        """Model with the parameters so far, without standard errors."""
        found: M = self._model.with_parameters(self._theta.tolist(), None)  # type: ignore[assignment]
        return found

    @property
    def mean_squared_error(self) -> float:
        """Squared errors and squared changes of initial outputs, for each predicted sample."""
        error = self.minimisation.error
        return mean_square(error) * error.size / self._samples

    @property
    def _theta(self) -> NDArray[np.float64]:
        return self.minimisation.theta[: len(self._model.parameters)]

    def estimate_errors(self) -> M:
        """Return the model with the parameters so far and with their standard errors.

        They take as long as two steps.
        """
        found, directions = self.minimisation, self._directions
        jacobian = self._residual.differentiate(found.theta, directions)
        covariance = sandwich_of_jacobian(jacobian, found.error, self._residual.intervals)
        directions = directions[: len(self._model.parameters)]
        squares = np.einsum("ti,ij,tj->t", directions, covariance, directions)
        errors = np.sqrt(np.maximum(squares, 0.0)).tolist()
        refined: M = self._model.with_parameters(self._theta.tolist(), errors)  # type: ignore[assignment]
        return refined


def refine(
    model: M,
    record: AnyRecord,
    interval: int | None,
    constraints: str = "none",
    warm_up: int | None = None,
    max_steps: int = 30,
    standard_errors: bool = True,
    stop: Callable[[], bool] = lambda: False,
) -> RefinedModel[M] | EvaluationOutcome:
    """Refine the parameters of a model on the multiple-shooting error.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model with parameters that meet the constraints. The parameters of all equations of several outputs
        are refined together.
    record : Dataset or CoupledRecord
    interval : int or None
        Length of a shooting interval in samples. None is the free run, whose initial outputs are estimated
        with the parameters of a NARX model: their noise may have an effect on the whole run.
    constraints : str
        Statements of ``constraint``. The refined model meets them.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.
    max_steps : int
        Maximum number of accepted steps. With 0 the parameters stay, and the model gets standard errors.
    standard_errors : bool
        Whether the model has standard errors, which take as long as two steps.
    stop : callable
        Called before each step. Once it returns true, the refinement ends with the parameters so far.

    Returns
    -------
    RefinedModel or EvaluationOutcome
        A model with standard errors from the final Jacobian, which allow for a coloured residual.
        INFEASIBLE if the structure cannot meet the constraint or contains a regressor whose parameter is
        forced to zero, DIVERGED if the initial model diverges.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        The record is incomplete, does not match the model (see `match_record`), or is too short.
    SettingsError
        The warm-up is shorter than the model's largest lag, the interval is less than 1, or the constraint
        is unknown.
    """
    begun = begin_refinement(model, record, interval, constraints, warm_up)
    if isinstance(begun, EvaluationOutcome):
        return begun
    found = begun.minimisation
    before = begun.mean_squared_error
    found.advance(max_steps, stop)
    refined = begun.estimate_errors() if standard_errors else begun.model
    return RefinedModel(refined, before, begun.mean_squared_error, found.steps)


def begin_refinement(
    model: M,
    record: AnyRecord,
    interval: int | None,
    constraints: str = "none",
    warm_up: int | None = None,
) -> Refinement[M] | EvaluationOutcome:
    """Begin the refinement of a model; see `refine` for the parameters, the outcomes and the errors."""
    constrained = constrain_model(model, constraints)
    if isinstance(constrained, EvaluationOutcome):
        return constrained
    # This call also checks the columns, the lags and the length of the record, which the kernel does not.
    started = multiple_shooting(model, record, interval, warm_up)
    if not started.outcome:
        return started.outcome
    if np.isnan(started.mean_squared_errors).any():
        raise RecordError("an output has missing samples: refinement needs every sample")
    if isinstance(record, CoupledRecord):
        record = match_coupled(cast("CoupledModel", model), record)
    else:
        record = match_record(cast("DynamicModel", model), record)
    theta = np.array(model.parameters)
    directions = find_directions(theta, constrained, _scale_steps(model, record))
    if isinstance(directions, EvaluationOutcome):
        return directions
    free = make_free_run_residual(model, record, warm_up) if interval is None else None
    residual = free or make_residual(model, record, interval, warm_up)
    if free is not None:
        scale = np.std(np.asarray(record.y)) or 1.0
        directions = scipy.linalg.block_diag(directions, scale * np.eye(free.changes))
    terms, values = theta.size, np.append(theta, np.zeros(len(directions) - theta.size))
    error = residual(values)
    if error is None:
        return EvaluationOutcome(Status.DIVERGED, "the free run with estimated initial outputs diverges")
    minimisation = Minimisation(
        *(residual, values, error, directions, _MIN_GAIN),
        lambda values: constrained.has_signs(values[:terms]),
    )
    return Refinement(model, residual, minimisation, directions)


def _scale_steps(model: AnyModel, record: AnyRecord) -> NDArray[np.float64]:
    """Return steps of similar size, one for each column, shape (terms, terms).

    The steps of a model with a constant turn about the mean of the record, so that their damping does not
    depend on the zeros of the units.
    """
    scale = np.diag(scale_parameters(np.array(model.parameters)))
    if isinstance(model, Model) and isinstance(record, Dataset):
        means = np.mean(np.vstack([record.y, record.u.T]), axis=1)
        expressions = [item.expression for item in model.regressors]
        for constant in (place for place, each in enumerate(expressions) if isinstance(each, Constant)):
            for place, each in enumerate(expressions):
                if isinstance(each, Lagged):
                    scale[constant, place] = -scale[place, place] * means[each.channel]
            scale[constant, constant] = np.std(record.y) or 1.0
    return scale
