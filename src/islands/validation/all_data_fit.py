"""Errors of a model with parameters that are estimated on all data, which are its evidence.

An information criterion is defined at the parameters that fit the data that it judges. With those of the
estimation data, a model is judged by an extrapolation where the validation data reach further: a term that
the estimation data hardly excite is then punished for parameters that they do not determine.
"""

from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from islands.estimation.estimator_table import Criterion
from islands.estimation.refit import refit
from islands.models.protocol import DynamicModel
from islands.progress import Failure, attempt
from islands.records.split import Split, join_parts
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.evidence import mean_square, measure_errors


class AllDataFit:
    """Estimate of the parameters of a model on estimation data and validation data together.

    The parameters stay if they cannot be estimated again, or if their errors on all data are smaller than
    those of the estimate: least squares does not minimise the error of the free run. Both attributes are
    computed when they are first read.

    Parameters
    ----------
    model : DynamicModel
        With the parameters of the estimation data.
    criterion : Criterion or None
        Error that the parameters minimise. None if they are given, and stay.
    split : Split
    constraints : str
        Constraints under which the parameters were estimated.
    warm_up : int
        Number of samples before the first prediction.
    errors : ndarray, shape (samples,)
        Errors of the free runs with these parameters; see `measure_errors`.
    """

    def __init__(
        self,
        model: DynamicModel,
        criterion: Criterion | None,
        split: Split,
        constraints: str,
        warm_up: int,
        errors: NDArray[np.float64],
    ) -> None:
        self._given, self._criterion, self._split = (model, errors), criterion, split
        self._constraints, self._warm_up = constraints, warm_up

    @property
    def model(self) -> DynamicModel:
        """Model with the parameters of all data."""
        return self._found[0]

    @property
    def errors(self) -> NDArray[np.float64]:
        """Errors of its free runs on both parts of the data, shape (samples,); see `join_errors`."""
        return self._found[1]

    @cached_property
    def _found(self) -> tuple[DynamicModel, NDArray[np.float64]]:
        if self._criterion is None:
            return self._given
        record = join_parts(self._split)
        arguments = self._given[0], self._criterion, record, self._constraints, self._warm_up
        estimated = attempt(partial(refit, *arguments))
        if isinstance(estimated, Failure | EvaluationOutcome):
            return self._given
        found = estimated, measure_errors(estimated, self._split, self._warm_up)
        return min(found, self._given, key=lambda each: mean_square(each[1]))
