"""`FittedModel`: one model of a result, new or read from a folder, or of a model file."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError, SettingsError, lookup
from islands.estimation.constraints.checks import ConstraintCheck
from islands.estimation.estimators import least_squares_bias
from islands.evolution.search_result import AnySearchResult, require_one_output
from islands.export import MODEL_FILE, export_or_write, return_or_write
from islands.facade.results.model_analysis import find_rest_of_data, linearise
from islands.facade.results.model_simulation import (
    SHOOTING,
    match_columns,
    predict,
    record_of_model,
    simulate,
)
from islands.facade.results.notebook_html import render_html
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel, coupled_signals, list_models
from islands.models.latent import LatentModel
from islands.models.linearisation import EVERYWHERE
from islands.models.narx import Model
from islands.models.operating_point import static_characteristic
from islands.models.protocol import DynamicModel
from islands.models.signal_statement import describe_signals
from islands.models.state_space import StateSpace
from islands.models.sympy_expression import to_sympy
from islands.persistence.ensembles import model_file
from islands.records.coupled import AnyRecord
from islands.report.figures.names import FREE_RUN, LINEAR_FIGURES
from islands.report.text.facts import BEFORE_REFIT, is_refitted
from islands.simulation.input_response import StepResponse, step_response
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation
from islands.simulation.stepper import Stepper
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.data_range import DataRange
from islands.validation.metrics import Metrics
from islands.validation.physics import PhysicsChecks
from islands.validation.predictable_residual import ResidualStructure
from islands.validation.prediction_bands import LEVEL, AnyBands, PredictionBand
from islands.validation.residual_tests import ResidualTests

if TYPE_CHECKING:
    import sympy
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from narwhals.typing import IntoSeries

    from islands.models.linearisation import OperatingPoint
    from islands.records.reading.data_frames import RecordLike


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FittedModel:
    """A model with its rank, its errors, and the settings of the simulations that measured them.

    Attributes
    ----------
    model : DynamicModel or CoupledModel
        Structure, parameters, standard errors; those of a refit, if there is one.
    rank : int or None
        Rank of the model; 1 has the least validation error. None for a model file outside of a result folder.
    metrics : mapping
        Errors by part and prediction, for example ``metrics["validation"]["free_run"].mape``, and of several
        outputs by output before them, ``metrics["y1"]["validation"]["free_run"].mape``; empty outside of a
        result folder. They are those of the parameters before a refit.
    warm_up : int
        Number of samples before the first prediction of the simulations of ``metrics``; the largest lag
        outside of a result folder.
    shooting_interval : int
        Steps of the model in each interval of multiple shooting.
    prediction_bands : PredictionBands, OutputBands or None
        Prediction bands of every level, of every output. None if the free run of the model diverged, the
        search was stopped before them, or a file has none.
    output_units : tuple of str
        Units of the outputs; each is empty if it is unknown.
    document : mapping
        Entry of the model in the ``result.json`` of the folder that it was read from: also physics checks,
        residual tests and constraints. Empty for a new result.
    """

    model: AnyModel
    rank: int | None
    metrics: Mapping[str, Any]
    warm_up: int
    shooting_interval: int
    prediction_bands: AnyBands | None
    output_units: tuple[str, ...]
    document: Mapping[str, Any] = field(default_factory=dict)
    _assessment: Assessment | None = None
    _search_result: AnySearchResult | None = None

    @classmethod
    def from_search(
        cls, rank: int, assessment: Assessment | CoupledAssessment, found: AnySearchResult
    ) -> "FittedModel":
        """Return a model of a search result."""
        units = tuple(each.output_unit for each in found.record.records)
        single = assessment if isinstance(assessment, Assessment) else None
        return cls(
            *(assessment.final_model, rank, assessment.metrics, assessment.warm_up, found.shooting_interval),
            *(assessment.bands, units, {}, single, found),
        )

    @classmethod
    def from_model(cls, model: AnyModel, bands: AnyBands | None = None) -> "FittedModel":
        """Return a model outside of a result, with the bands of its file."""
        return cls(model, None, {}, model.maximum_lag, SHOOTING, bands, ("",) * len(list_models(model)))

    @property
    def assessment(self) -> Assessment:
        """Errors, residual tests and physics checks of the search, of the parameters before a refit.

        Raises
        ------
        ModelError
            The model was read from a file or a folder, or has several outputs.
        """
        if self._assessment is None:
            require_one_output(self.search_result)
            raise _missing_search()
        return self._assessment

    @property
    def is_refitted(self) -> bool:
        """Whether the parameters were estimated again on all data, after the errors were measured."""
        if self._assessment is None:
            return is_refitted(self.document)
        return self._assessment.refit is not None and not self._assessment.refit.discarded

    @property
    def search_result(self) -> AnySearchResult:
        """Result of the search that the model belongs to.

        Raises
        ------
        ModelError
            The model was read from a file or a folder.
        """
        if self._search_result is None:
            raise _missing_search()
        return self._search_result

    @property
    def validation(self) -> AnyRecord:
        """Validation data of the search.

        Raises
        ------
        ModelError
            The model was read from a file or a folder, which have no data.
        """
        return self.search_result.split.validation

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(each.output_name for each in list_models(self.model))

    @property
    def equation(self) -> str:
        """Equation as plain text, with the column names of the record."""
        return self.model.equation().named

    @property
    def latex(self) -> str:
        """Equation in LaTeX."""
        return self.model.equation().latex

    @property
    def signals(self) -> str:
        """Signals that the equation reads: deviations, filtered samples or means; empty for the record's."""
        if isinstance(self.model, CoupledModel):
            return coupled_signals(self.model)
        return describe_signals(self.model)

    def to_sympy(self) -> "sympy.Eq":
        """Return the model as a SymPy equation; see `to_sympy` (extra ``sympy``)."""
        return to_sympy(self._require_one_output())

    def linearise(
        self, operating_point: "OperatingPoint | None" = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Linearise the model, with the uncertainty of its ensemble; see `islands.linearise`.

        Parameters
        ----------
        operating_point, y
            As in `islands.linearise`. By default the operating point is that of a latent model, and for a
            NARX model of a result the middle of the range of every input in its data; of several equilibria,
            the only one within the range of the output is taken.
        """
        bands, data = self.prediction_bands, self._data_range
        if data is not None and not isinstance(self.model, LatentModel | CoupledLatentModel):
            if operating_point is None:
                operating_point = [0.5 * (low + high) for low, high in data.inputs]
            if y is None and isinstance(self.model, Model):
                y = find_rest_of_data(self.model, operating_point, data.output)
        found = linearise(self.model, operating_point, y, None if bands is None else bands.ensemble)
        units = zip(self.output_units, found.output_units, strict=True)
        return replace(found, output_units=tuple(own or other for own, other in units))

    @property
    def _data_range(self) -> DataRange | None:
        """Range of the inputs and of the first output; None if it is not known."""
        return self.prediction_bands.outputs[0].data_range if self.prediction_bands else None

    @property
    def _output_range(self) -> tuple[float, float]:
        """Range of the output in which the model rests, if it rests at several."""
        data = self._data_range
        return data.output if data and not isinstance(self.model, CoupledModel) else EVERYWHERE

    @property
    def linear_system(self) -> StateSpace | None:
        """Linear system about the operating point of `linearise`; None without one, and of a static model."""
        with suppress(ModelError):
            found = self.linearise()
            return None if found.is_static else found
        return None

    def plot_linear(
        self, kind: str = "bode", operating_point: "OperatingPoint | None" = None, y: ArrayLike | None = None
    ) -> "Figure":
        """Draw the linear system of the model about an operating point, with 90 % bands if they are known.

        Parameters
        ----------
        kind : str
            ``bode``, ``nyquist``, ``pole-map`` or ``unit-step``.
        operating_point, y
            As in `linearise`.
        """
        from islands.report.figures.linear_system import draw_linear_system  # noqa: PLC0415 - matplotlib

        return draw_linear_system(self.linearise(operating_point, y), kind)

    def static_characteristic(self, inputs: ArrayLike) -> NDArray[np.float64]:
        """Return the output at rest for constant inputs; see `static_characteristic`."""
        return static_characteristic(self.model, inputs)

    def plot_static_characteristic(self, inputs: Sequence[float], *, ax: "Axes | None" = None) -> "Figure":
        """Draw the output at rest over a constant input, for models with one input.

        Parameters
        ----------
        inputs : sequence of float
        ax : Axes, optional
            Axes to draw into; by default those of a new figure.

        Raises
        ------
        ModelError
            As in `static_characteristic`, or the model has several inputs.
        """
        from islands.report.figures.model_responses import draw_static_characteristic  # noqa: PLC0415 - matplotlib

        model = self._require_one_output()
        if model.inputs > 1:
            raise ModelError(
                "a characteristic curve has one input: draw a section of static_characteristic()"
            )
        return draw_static_characteristic(model, inputs, self.static_characteristic(inputs), ax)

    def step_response(
        self, start: ArrayLike, end: ArrayLike, y: float | None = None, samples: int | None = None
    ) -> StepResponse:
        """Simulate the response to a step of the inputs from rest; see `step_response`."""
        return step_response(self._require_one_output(), start, end, y, samples)

    def plot_step_response(
        self,
        start: ArrayLike,
        end: ArrayLike,
        y: float | None = None,
        samples: int | None = None,
        *,
        ax: "Axes | None" = None,
    ) -> "Figure":
        """Draw the response to a step of the inputs from rest.

        Parameters
        ----------
        start, end, y, samples
            As in `step_response`.
        ax : Axes, optional
            Axes to draw into; by default those of a new figure.
        """
        from islands.report.figures.model_responses import draw_step_response  # noqa: PLC0415 - matplotlib

        return draw_step_response(self.step_response(start, end, y, samples), ax)

    @property
    def physics(self) -> PhysicsChecks:
        """Physics checks: cluster sums, holds, minor loops, other amplitudes and rates."""
        return self.assessment.final_physics

    @property
    def constraints(self) -> tuple[ConstraintCheck, ...]:
        """Constraints of the search, each with its target and the value of this model."""
        return self.assessment.final_constraints

    @property
    def residual_tests(self) -> ResidualTests:
        """Correlation tests of the one-step-ahead residual."""
        return self.assessment.residual_tests

    @property
    def residual_structure(self) -> ResidualStructure:
        """Predictable part of the residuals, and a verdict: adequate, minor or inadequate."""
        return self.assessment.residual_structure

    @property
    def inclusion(self) -> tuple[float, ...]:
        """Inclusion probability of every term, in the order of the model; empty for named parameters.

        Raises
        ------
        ModelError
            The result has no ensemble, or was read from a folder, whose `document` has them.
        """
        ensemble = self.search_result.ensemble
        if ensemble is None:
            raise ModelError("the result has no ensemble: the free run of every model diverged")
        # A name has another meaning in another structure.
        return tuple(
            map(ensemble.inclusion, self.model.parameter_names if isinstance(self.model, Model) else ())
        )

    @property
    def least_squares_bias(self) -> float | None:
        """Largest bias of least squares for this structure, in standard errors; None if it is unknown.

        Above 2 to 3 the noise is coloured or a term is missing: take another entry of ``ESTIMATORS``. The
        estimation runs at each access.
        """
        result = require_one_output(self.search_result)
        found = least_squares_bias(
            self._require_one_output(), result.split.estimation, str(result.settings["constraints"])
        )
        return None if isinstance(found, EvaluationOutcome) else found

    def predict(
        self,
        record: "RecordLike",
        y: "ArrayLike | IntoSeries | None" = None,
        dt: float | None = None,
        *,
        inputs: str | Sequence[str] = (),
        output: str | Sequence[str] | None = None,
    ) -> NDArray[np.float64]:
        """Return the free run of the model, one value of each output for every row of the data.

        It starts from the first samples of the output, as many as the largest lag of the model. If their
        noise has an effect on the whole run, they are estimated from the first samples that are known: the
        first 100 of a segment, or the first tenth. `simulate` starts later, after the warm-up of `metrics`.

        Parameters
        ----------
        record : record, data frame or array
            Inputs, and the outputs, of which only the first samples are used; others may be missing.
        y, dt, inputs, output
            As in `as_record`. By default the columns and the sampling time are those of the model.

        Returns
        -------
        ndarray, shape (samples,) or (samples, outputs)
            Each row of a model of means has the prediction of its mean. NaN during the warm-up of every
            segment and after a divergence.

        Raises
        ------
        RecordError
            The data do not match the model (the message lists the columns), are too short, or the output is
            missing in the warm-up.
        """
        return predict(self.model, record_of_model(self.model, record, y, dt, inputs, output))

    def simulate(
        self,
        record: "RecordLike",
        mode: str = "free-run",
        warm_up: int | None = None,
        shooting: int | None = None,
        y: ArrayLike | None = None,
        states: Sequence[float] | None = None,
    ) -> Simulation:
        """Simulate the model on a record, or on inputs alone.

        On the validation data, the errors of the simulation are those in `metrics`, unless the parameters
        were estimated again on all data. A free run starts as that of `predict`.

        Parameters
        ----------
        record : record, data frame or array
            Its samples are averaged as in the search if it has the sampling time of the search's record. An
            array, or a frame without the output, is simulated from rest at its first inputs, and every
            sample is predicted. A list of frames has several recordings.
        mode : str
            ``one-step``, ``shooting`` or ``free-run``.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors in `metrics`.
        shooting : int, optional
            Steps of the model in each shooting interval; by default those of the errors in `metrics`.
        y, states
            Outputs before the first sample, or states of a latent model at the first sample, from which to
            start in place of the measured outputs.
        """
        warm_up = self.warm_up if warm_up is None else warm_up
        shooting = self.shooting_interval if shooting is None else shooting
        start: dict[str, Any] = {"y": y, "states": states, "within": self._output_range}
        return simulate(self.model, record, mode, shooting, warm_up=warm_up, **start)

    def stepper(
        self,
        u: "OperatingPoint | None" = None,
        y: ArrayLike | None = None,
        states: Sequence[float] | None = None,
    ) -> Stepper:
        """Return a simulation that computes one sample at a time, for observers and controllers.

        Its outputs have the bits of `simulate` on the same inputs.

        Parameters
        ----------
        u, y, states
            Inputs and outputs before the first sample, or states at the first one; see `Stepper`.
        """
        return Stepper(self.model, u, y, states, self._output_range)

    def bands(self, record: "RecordLike", level: float = LEVEL, warm_up: int | None = None) -> PredictionBand:
        """Simulate the model on a record, with a band that contains a measured sample with a probability.

        The arrays of the band have the shape (samples,), or (samples, outputs) of several outputs.

        Parameters
        ----------
        record : record or data frame
            Inputs, and the outputs of the warm-up; averaged as in `simulate`.
        level : float
            Probability, between 0.5 and 0.99.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors in `metrics`.

        Raises
        ------
        ModelError
            The free runs of the model diverged on the data that calibrate the bands, the search was stopped
            before them, or the model is of no result.
        SettingsError
            The level is out of range.
        """
        if self.prediction_bands is None and self.rank is None:
            raise ModelError(
                "this model file has no prediction bands: give the folder of its result, or a file that "
                "'islands show FOLDER --format json' wrote"
            )
        if self.prediction_bands is None:
            raise ModelError(
                f"model {self.rank} has no prediction bands: its free run diverged, or the search was "
                "stopped before them. Take another model"
            )
        warm_up = self.warm_up if warm_up is None else warm_up
        data = match_columns(self.model, record_of_model(self.model, record))
        return self.prediction_bands.predict(self.model, data, level, warm_up)

    def plot(
        self,
        kind: str = "free-run",
        record: "RecordLike | None" = None,
        *,
        output: str | None = None,
        ax: "Axes | None" = None,
    ) -> "Figure":
        """Draw a figure of the model.

        Parameters
        ----------
        kind : str
            A key of ``islands.report.figures.registry.FIGURES``: ``free-run`` (or ``free_run``, as in
            ``metrics``), ``loop``, ``hold``, ``residuals``; of static models ``static-curve``; of latent
            models ``structure`` and ``curves``; or one of `plot_linear`, which needs no record.
        record : record or data frame, optional
            Record that is drawn; by default the validation data, with the parameters that the errors on them
            belong to. A frame has the columns of the model.
        output : str, optional
            Output to draw, of several; by default all of them, without bands. They have the free run alone;
            `Result.outputs` has the other figures.
        ax : Axes, optional
            Axes to draw into, for the kinds of ``PANELS``: of a figure with several panels, the first.

        Returns
        -------
        Figure
            A new figure, or that of the axes.

        Raises
        ------
        SettingsError
            There is no such figure, or it does not fit into one axes.
        RecordError
            The record does not match the model.
        ModelError
            The result was read from a folder without the record, and no record is given; or the model lacks
            what the figure shows, as units.
        """
        # matplotlib takes half a second to import, which every process of a cluster would pay.
        from islands.report.figures.registry import FIGURES, draw_record_figure  # noqa: PLC0415

        kind = kind.replace("_", "-")
        if kind in LINEAR_FIGURES and ax is None:
            return self.plot_linear(kind)
        data = None if record is None else record_of_model(self.model, record)
        if isinstance(self.model, CoupledModel):
            return self._plot_outputs(self.model, kind, self.validation if data is None else data, output, ax)
        if output not in (None, self.model.output_name):
            raise SettingsError(f"the model has the output {self.model.output_name}, not {output}")
        if data is None and ax is None:
            found = require_one_output(self.search_result)
            return lookup(FIGURES, kind, "figure")(self.assessment, found.split)
        model = self.assessment.model if data is None else self.model
        (single,) = (self.validation if data is None else match_columns(model, data)).records
        bands = None if self.prediction_bands is None else self.prediction_bands.outputs[0]
        return draw_record_figure(kind, model, single, self.warm_up, bands, ax)

    def _plot_outputs(
        self, model: CoupledModel, kind: str, record: AnyRecord, output: str | None, ax: "Axes | None"
    ) -> "Figure":
        """Draw the free run of one of several outputs, or of all of them."""
        from islands.report.figures.free_run import (  # noqa: PLC0415 - matplotlib
            draw_free_run,
            draw_free_run_panel,
            draw_free_runs,
        )

        if kind != FREE_RUN:
            raise SettingsError(
                f"a model of several outputs has the figures {', '.join((FREE_RUN, *LINEAR_FIGURES))}: take "
                f"others of the separate results, as result.outputs[0].plot({kind!r})"
            )
        data = match_columns(model, record)
        runs = self.simulate(data).y.T
        if output is None and ax is None:
            return draw_free_runs(data.records, list(runs))
        if output not in model.output_names:
            raise SettingsError(f"name one output as output=..., of {', '.join(model.output_names)}")
        place = model.output_names.index(output)
        if ax is not None:
            draw_free_run_panel(ax, data.records[place], runs[place])
            return cast("Figure", ax.get_figure(root=True))
        band = None if self.prediction_bands is None else self.bands(data).outputs[place]
        return draw_free_run(data.records[place], runs[place], band=band)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the model as text, or write it to a file.

        Parameters
        ----------
        kind : str
            plain, latex, mathml, python, c, matlab or json, which has the uncertainty of the model; with a
            path also fmu (FMI 3.0) or fmu2.
        path : str or Path, optional
            File to write; nothing is returned then.

        Raises
        ------
        SettingsError
            The format is unknown, or is not text and no path is given.
        """
        if kind == MODEL_FILE:
            return return_or_write(model_file(self.model, self.prediction_bands), path)
        return export_or_write(self.model, kind, path)

    def __str__(self) -> str:
        return self.equation

    def __repr__(self) -> str:
        rank = "" if self.rank is None else f" of rank {self.rank}"
        return f"<{type(self).__name__}{rank}: {self.equation}>"

    def _repr_html_(self) -> str:
        figure = None if self._search_result is None else self.plot()
        return render_html(self.model, self.describe_errors() if self.metrics else [], figure)

    def describe_errors(self) -> list[str]:
        """Return the rank and the error of every output as sentences."""
        refitted = f", {BEFORE_REFIT}" if self.is_refitted else ""
        named = list_metrics(self.metrics).items()
        return [
            f"Rank {self.rank}: free-run RMSE {f'of {name} ' if name else ''}on the validation data "
            f"{errors['validation']['free_run'].rmse:.4g} {unit}".rstrip()
            + refitted
            for (name, errors), unit in zip(named, self.output_units, strict=True)
        ]

    def _require_one_output(self) -> DynamicModel:
        """Return the model.

        Raises
        ------
        ModelError
            It has several outputs.
        """
        if isinstance(self.model, CoupledModel):
            raise ModelError("the model has several outputs: take a separate one, as result.outputs[0].best")
        return self.model


def list_metrics(metrics: Mapping[str, Any]) -> Mapping[str, Mapping[str, Mapping[str, Metrics]]]:
    """Return the errors of a model by output; that of a model of one output has no name."""
    return {"": metrics} if "validation" in metrics and "free_run" in metrics["validation"] else metrics


def _missing_search() -> ModelError:
    """Return the error of a property that needs the record and the search."""
    return ModelError(
        "a model that was read has no data of its search: give a record, as plot(record=...), or take its "
        "checks from `document`"
    )
