"""Assessment of a model: errors, residual tests, physics checks and prediction bands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isnan, nan
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.constraints.checks import ConstraintCheck, check_constraints
from islands.estimation.constraints.state_space import linearise_constraints
from islands.estimation.estimator_table import Criterion
from islands.estimation.parameter_constraints import count_free_parameters
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.progress import Failure, attempt
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.simulation.initial_outputs import has_estimated_start, simulate_freely
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation, multiple_shooting, one_step_ahead
from islands.validation.all_data_fit import AllDataFit
from islands.validation.evidence import join_errors, mean_square, measure_size
from islands.validation.metrics import InformationCriteria, Metrics, information_criteria, metrics
from islands.validation.physics import PhysicsChecks, check_physics, missing_physics
from islands.validation.predictable_residual import ResidualStructure, measure_structure, missing_structure
from islands.validation.prediction_bands import PredictionBands
from islands.validation.residual_tests import ResidualTests, residual_tests
from islands.validation.unit_laws import UnitLaw, name_unit_laws

R = TypeVar("R")

#: Parts of a split, as named in a result.
PARTS = ("estimation", "validation")

#: Kinds of simulation, as named in a result.
MODES = ("one_step_ahead", "multiple_shooting", "free_run")

#: Metrics of a diverged simulation.
_UNDEFINED = Metrics(nan, nan, nan, nan)

#: Minimum number of residuals for a test at one lag.
_MIN_RESIDUALS = 3


class Checks:
    """Checks of a model that take longer than its errors: each is made when it is first read.

    A check that fails has a value that states the reason, so that the model and its errors remain.

    Parameters
    ----------
    model : DynamicModel
    split : Split
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.
    missing : str
        Why the checks are not made; empty if they are.
    """

    def __init__(self, model: DynamicModel, split: Split, warm_up: int | None, missing: str = "") -> None:
        self._model, self._split, self._warm_up, self._missing = model, split, warm_up, missing

    @property
    def split(self) -> Split:
        """Estimation data and validation data."""
        return self._split

    def without(self, reason: str) -> "Checks":
        """Return checks that are not made, for a reason."""
        return Checks(self._model, self._split, self._warm_up, reason)

    @cached_property
    def physics(self) -> PhysicsChecks:
        """Physics checks on the estimation data."""
        found = self._attempt(lambda: check_physics(self._model, self._split.estimation))
        return missing_physics(found.reason) if isinstance(found, Failure) else found

    @cached_property
    def residual(self) -> tuple[ResidualTests, ResidualStructure]:
        """Tests of the residuals on the validation data; see `assess_residual`."""
        data = self._split.validation
        found = self._attempt(lambda: assess_residual(self._model, data, self._warm_up))
        return _missing_tests(found.reason) if isinstance(found, Failure) else found

    @cached_property
    def laws(self) -> tuple[UnitLaw, ...]:
        """Laws of the curves of a latent model; see `name_unit_laws`."""
        model = self._model
        if not isinstance(model, LatentModel) or not model.units:
            return ()
        first = model.maximum_lag if self._warm_up is None else self._warm_up
        found = self._attempt(lambda: name_unit_laws(model, self._split, first))
        return () if isinstance(found, Failure) else found

    def _attempt(self, compute: Callable[[], R]) -> R | Failure:
        return Failure(self._missing) if self._missing else attempt(compute)

    @cached_property
    def has_estimated_start(self) -> bool:
        """Whether the free run on the validation data starts from estimated outputs."""
        return has_estimated_start(self._model, self._split.validation, self._warm_up)


@dataclass(frozen=True, slots=True, eq=False)
class Refit:
    """Estimate of the parameters of an assessed model on all data, after the validation data have ranked it.

    The validation data have a part in these parameters, so that no error on them is measured.

    Attributes
    ----------
    model : DynamicModel
        With the new parameters and their standard errors. The assessed model if they are discarded.
    samples : int
        Samples of all data.
    discarded : str
        Why the new parameters are discarded; empty if they are not.
    checks : Checks
        Of the model: its physics checks count, and its residuals are not tested.
    constraints : tuple of ConstraintCheck
        As of an `Assessment`, with the values of this model.
    """

    model: DynamicModel
    samples: int
    discarded: str
    checks: Checks
    constraints: tuple[ConstraintCheck, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """A model with its errors, residual tests and physics checks.

    Attributes
    ----------
    model : DynamicModel
        Model that all errors, tests and checks here belong to; see ``final_model``.
    metrics : mapping
        ``metrics[part][mode]``, NaN if the simulation diverged.
    outcomes : mapping
        ``outcomes[part][mode]``.
    information : InformationCriteria
        Information criteria of the one-step-ahead residual on the estimation data. NaN if it diverged. The
        number of parameters is that of the free ones: the terms minus the independent constraints.
    checks : Checks
        Residual tests and physics checks, which are made when they are read.
    warm_up : int
        Number of samples before the first prediction of these simulations. The errors depend on it.
    all_data : AllDataFit
        Errors with parameters that are estimated on all data, by which models are compared.
    constraints : tuple of ConstraintCheck
        The constraints, each with its target and the value of the model.
    recordings : mapping
        ``recordings[part][name]``: metrics of the free run on each recording, with the range of the whole
        part as the scale of the MAPE. Empty for a part that consists of one recording.
    bands : PredictionBands or None
        Prediction bands of the free run. None without an ensemble, or if its free runs diverge.
    criterion : Criterion or None
        Error that the parameters minimise. None if they are given.
    refit : Refit or None
        Estimate of the parameters on all data, if there is one.
    """

    model: DynamicModel
    metrics: Mapping[str, Mapping[str, Metrics]]
    outcomes: Mapping[str, Mapping[str, EvaluationOutcome]]
    information: InformationCriteria
    checks: Checks
    warm_up: int
    all_data: AllDataFit
    constraints: tuple[ConstraintCheck, ...] = ()
    recordings: Mapping[str, Mapping[str, Metrics]] = field(default_factory=dict)
    bands: PredictionBands | None = None
    criterion: Criterion | None = None
    refit: Refit | None = None

    @property
    def final_model(self) -> DynamicModel:
        """Model for use: that of the refit, if there is one."""
        return self.refit.model if self.refit else self.model

    @property
    def final_physics(self) -> PhysicsChecks:
        """Physics checks of the final model."""
        return self.refit.checks.physics if self.refit else self.physics

    @property
    def final_constraints(self) -> tuple[ConstraintCheck, ...]:
        """Constraints with the values of the final model."""
        return self.refit.constraints if self.refit else self.constraints

    @property
    def size(self) -> float:
        """Number of terms by which the model is compared; see `measure_size`."""
        return measure_size(self.model)

    @property
    def validation_error(self) -> float:
        """RMSE of the free run on the validation data; infinite if it diverges."""
        error = self.metrics["validation"]["free_run"].rmse
        return inf if isnan(error) else error

    @property
    def errors(self) -> NDArray[np.float64]:
        """Errors of the free runs on both parts of the data, with the parameters of all data."""
        return self.all_data.errors

    @property
    def mean_square(self) -> float:
        """Mean square of these errors; infinite after a divergence."""
        return mean_square(self.errors)

    @property
    def split(self) -> Split:
        """Estimation data and validation data."""
        return self.checks.split

    @property
    def physics(self) -> PhysicsChecks:
        """Physics checks on the estimation data."""
        return self.checks.physics

    @property
    def residual_tests(self) -> ResidualTests:
        """Tests of the one-step-ahead residual on the longest recording of the validation data.

        If the prediction diverged, all tests failed and their notes give the reason.
        """
        return self.checks.residual[0]

    @property
    def residual_structure(self) -> ResidualStructure:
        """Predictable part of the residuals on the same recording, and a verdict."""
        return self.checks.residual[1]

    @property
    def has_estimated_start(self) -> bool:
        """Whether the free run on the validation data starts from estimated outputs."""
        return self.checks.has_estimated_start


def assess(
    model: DynamicModel,
    split: Split,
    shooting: int,
    warm_up: int | None = None,
    constraints: str = "none",
    criterion: Criterion | None = None,
) -> Assessment:
    """Assess a model on the estimation data and the validation data.

    Parameters
    ----------
    model : DynamicModel
    split : Split
    shooting : int
        Length of a multiple-shooting interval in samples.
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.
    constraints : str
        Constraints under which the parameters were estimated.
    criterion : Criterion or None
        Error that the parameters minimise. None if they are given.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        A part has a different number of inputs, missing outputs, or is too short for a prediction, or the
        validation data is too short for the residual tests.
    SettingsError
        The warm-up is shorter than the model's largest lag, the interval is less than 1, the estimation data
        has too few samples for the number of free parameters, or the constraint is unknown.
    """
    errors: dict[str, dict[str, Metrics]] = {}
    outcomes: dict[str, dict[str, EvaluationOutcome]] = {}
    recordings: dict[str, dict[str, Metrics]] = {}
    runs: dict[str, dict[str, Simulation]] = {}
    for part, record in zip(PARTS, (split.estimation, split.validation), strict=True):
        simulated = (
            one_step_ahead(model, record, warm_up),
            multiple_shooting(model, record, shooting, warm_up),
            simulate_freely(model, record, warm_up),
        )
        found = dict(zip(MODES, simulated, strict=True))
        outcomes[part] = {mode: run.outcome for mode, run in found.items()}
        errors[part] = {
            mode: metrics(record.y, run.y) if run.outcome else _UNDEFINED for mode, run in found.items()
        }
        recordings[part] = _compute_recording_metrics(record, found["free_run"])
        runs[part] = found
    first = model.maximum_lag if warm_up is None else warm_up
    _find_longest_recording(split.validation, first)  # before the checks are read
    if isinstance(model, LatentModel):
        free = model.size - len(linearise_constraints(model, constraints).c)
    else:
        free = count_free_parameters(model, constraints)
    return Assessment(
        model,
        errors,
        outcomes,
        _compute_information(split.estimation, runs["estimation"]["one_step_ahead"], free),
        Checks(model, split, warm_up),
        first,
        AllDataFit(
            *(model, criterion, split, constraints, first),
            join_errors(*((getattr(split, part), runs[part]["free_run"]) for part in PARTS)),
        ),
        check_constraints(model, constraints),
        recordings,
        criterion=criterion,
    )


def with_refit(
    entry: Assessment, model: DynamicModel, samples: int, discarded: str, split: Split, constraints: str
) -> Assessment:
    """Return an assessment with the estimate of its parameters on all data.

    Parameters
    ----------
    entry : Assessment
    model : DynamicModel
        Model of that estimate. If it is discarded, the model of the assessment takes its place.
    samples : int
        Samples of all data.
    discarded : str
        Why the estimate is discarded; empty if it is not.
    split : Split
        Split of the assessment.
    constraints : str
        Constraints under which the parameters were estimated.
    """
    if discarded:
        return replace(entry, refit=Refit(entry.model, samples, discarded, entry.checks, entry.constraints))
    checks = Checks(model, split, entry.warm_up)
    return replace(entry, refit=Refit(model, samples, "", checks, check_constraints(model, constraints)))


def _compute_recording_metrics(record: Dataset, run: Simulation) -> dict[str, Metrics]:
    rows = record.rows_by_recording
    if len(rows) == 1:
        return {}
    return {name: metrics(record.y[each], run.y[each], record.output_range) for name, each in rows.items()}


def _compute_information(record: Dataset, one_step: Simulation, free: int) -> InformationCriteria:
    if not one_step.outcome:
        return InformationCriteria(nan, nan, nan)
    residual = (record.y - one_step.y)[~np.isnan(one_step.y)]
    return information_criteria(float(np.add.reduce(residual**2)), len(residual), free)


def assess_residual(
    model: DynamicModel, record: Dataset, warm_up: int | None
) -> tuple[ResidualTests, ResidualStructure]:
    """Test the residuals of a model on the longest recording of a record.

    Parameters
    ----------
    model : DynamicModel
    record : Dataset
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.

    Raises
    ------
    ModelError, RecordError, SettingsError
        As in `assess`.
    """
    first = model.maximum_lag if warm_up is None else warm_up
    recording = _find_longest_recording(record, first)
    samples = recording.samples - first
    runs = [one_step_ahead(model, recording, warm_up), simulate_freely(model, recording, warm_up)]
    one_step, simulated = ((recording.y - run.y)[first:] if run.outcome else None for run in runs)
    structure = measure_structure(
        one_step, simulated, recording.u[first:], recording.y[first:], record.output_range
    )
    # After a divergence the tests run on zeros for their structure, and are then marked as failed.
    residual = np.zeros(samples) if one_step is None else one_step
    tests = residual_tests(residual, recording.u[first:], max_lag=min(25, (samples - 2) // 2) or 1)
    if one_step is None:
        tests = _mark_failed(tests, f"diverged: {runs[0].outcome.reason}")
    return tests, structure


def _find_longest_recording(record: Dataset, warm_up: int) -> Dataset:
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    if end - begin - warm_up < _MIN_RESIDUALS:
        raise RecordError(
            f"the longest recording of the validation data has {end - begin} samples, of which the "
            f"warm-up takes {warm_up}: testing the residual takes {_MIN_RESIDUALS} more; "
            "give a longer recording"
        )
    return record[begin:end]


def _missing_tests(reason: str) -> tuple[ResidualTests, ResidualStructure]:
    return ResidualTests((), whiteness_p=nan, ljung_box=nan, passed=False), missing_structure(reason)


def _mark_failed(tests: ResidualTests, reason: str) -> ResidualTests:
    entries = tuple(replace(test, passed=False, note=reason) for test in tests.tests)
    return ResidualTests(entries, whiteness_p=nan, ljung_box=nan, passed=False)
