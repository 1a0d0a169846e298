"""One model of a `Result`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from islands.data.dataset import Dataset
from islands.errors import ModelError, lookup
from islands.estimation.constraints.checks import ConstraintCheck
from islands.estimation.estimators import least_squares_bias
from islands.evolution.search_result import RankedModel, SearchResult
from islands.facade.results.assessed_model import AssessedModel
from islands.model.model import Model
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.metrics import Metrics
from islands.validation.physics import PhysicsChecks
from islands.validation.predictable_residual import ResidualStructure
from islands.validation.prediction_bands import PredictionBands
from islands.validation.residual_tests import ResidualTests

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FittedModel(AssessedModel):
    """One model of a result.

    Attributes
    ----------
    rank : int
        Rank of the model; 1 has the least validation error.
    ranked_model : RankedModel
        Model with its errors, residual tests and physics checks.
    search_result : SearchResult
        Result that the model belongs to.
    """

    rank: int
    ranked_model: RankedModel
    search_result: SearchResult

    @property
    def model(self) -> Model:
        """Model: regressors, parameters, standard errors."""
        return self.ranked_model.model

    @property
    def metrics(self) -> Mapping[str, Mapping[str, Metrics]]:
        """Errors by part and prediction, for example ``metrics["validation"]["free_run"].mape``."""
        return self.ranked_model.assessment.metrics

    @property
    def warm_up(self) -> int:
        """Number of samples before the first prediction of the simulations of `metrics`."""
        return self.ranked_model.assessment.warm_up

    @property
    def shooting_interval(self) -> int:
        """Steps of the model in each interval of multiple shooting."""
        return self.search_result.shooting_interval

    @property
    def prediction_bands(self) -> PredictionBands | None:
        """Prediction bands of every level; None if the free run of the model diverged."""
        return self.ranked_model.bands

    @property
    def output_unit(self) -> str:
        """Unit of the output; empty if unknown."""
        return self.search_result.record.output_unit

    @property
    def validation(self) -> Dataset:
        """Validation data of the search."""
        return self.search_result.split.validation

    def _draw(self, kind: str) -> "Figure":
        from islands.figures.registry import FIGURES  # noqa: PLC0415 - as in `AssessedModel.plot`

        return lookup(FIGURES, kind, "figure")(self.ranked_model, self.search_result.split)

    @property
    def physics(self) -> PhysicsChecks:
        """Physics checks: cluster sums, holds, minor loops, other amplitudes and rates."""
        return self.ranked_model.assessment.physics

    @property
    def constraints(self) -> tuple[ConstraintCheck, ...]:
        """Constraints of the search, each with its target and the value of this model."""
        return self.ranked_model.assessment.constraints

    @property
    def residual_tests(self) -> ResidualTests:
        """Correlation tests of the one-step-ahead residual."""
        return self.ranked_model.assessment.residual_tests

    @property
    def residual_structure(self) -> ResidualStructure:
        """Predictable part of the residuals, and a verdict: adequate, minor or inadequate."""
        return self.ranked_model.assessment.residual_structure

    @property
    def inclusion(self) -> tuple[float, ...]:
        """Inclusion probability of every term, in the order of the model.

        Raises
        ------
        ModelError
            The result has no ensemble.
        """
        ensemble = self.search_result.ensemble
        if ensemble is None:
            raise ModelError("the result has no ensemble: the free run of every model diverged")
        return tuple(ensemble.inclusion(item) for item in self.model.regressors)

    @property
    def least_squares_bias(self) -> float | None:
        """Largest bias of least squares for this structure, in standard errors; None if it is unknown.

        Above 2 to 3 the noise is coloured or a term is missing: take another entry of ``ESTIMATORS``. The
        estimation runs at each access.
        """
        result = self.search_result
        found = least_squares_bias(self.model, result.split.estimation, str(result.settings["constraints"]))
        return None if isinstance(found, EvaluationOutcome) else found
