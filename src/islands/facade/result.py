"""Result objects of `fit` and `identify`, and `simulate`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from islands.data.compatibility import match_rate
from islands.data.dataset import Dataset
from islands.errors import ModelError, SettingsError, lookup
from islands.estimation.constraints.constraint_checks import ConstraintCheck
from islands.estimation.estimators import least_squares_bias
from islands.evolution.search_result import RankedModel, SearchResult
from islands.facade.notebook_html import render_html
from islands.io.export import export
from islands.io.model_description import describe
from islands.io.result_folder import write_result
from islands.io.summary_text import summary
from islands.model.equations import equation, latex_equation
from islands.model.model import Model
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation, multiple_shooting
from islands.validation.metrics import Metrics
from islands.validation.physics import PhysicsChecks
from islands.validation.predictable_residual import ResidualStructure
from islands.validation.prediction_bands import LEVEL, PredictionBand
from islands.validation.recommendation import Recommendation
from islands.validation.residual_tests import ResidualTests

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from islands.io.simulator_spec.specification import LocalSpec, SimulationSpec

#: Simulation modes, by the names of the command line.
SIMULATION_MODES = ("one-step", "shooting", "free-run")


@dataclass(frozen=True, slots=True, eq=False)
class FittedModel:
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
    def equation(self) -> str:
        """Equation as plain text."""
        return equation(self.model)

    @property
    def latex(self) -> str:
        """Equation in LaTeX."""
        return latex_equation(self.model)

    @property
    def metrics(self) -> Mapping[str, Mapping[str, Metrics]]:
        """Errors by part and prediction, for example ``metrics["validation"]["free_run"].mape``."""
        return self.ranked_model.assessment.metrics

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

    def simulate(self, record: Dataset, mode: str = "free-run", warm_up: int | None = None) -> Simulation:
        """Simulate the model on a record.

        On the validation data, the errors of the simulation are those in `metrics`.

        Parameters
        ----------
        record : Dataset
            Its samples are averaged as in the search if it has the sampling time of the search's record.
        mode : str
            ``one-step``, ``shooting`` or ``free-run``.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors in `metrics`.
        """
        shooting = self.search_result.shooting_interval
        warm_up = self.ranked_model.assessment.warm_up if warm_up is None else warm_up
        return simulate(self.model, record, mode, shooting, warm_up=warm_up)

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

    def bands(self, record: Dataset, level: float = LEVEL, warm_up: int | None = None) -> PredictionBand:
        """Simulate the model on a record, with a band that contains a measured sample with a probability.

        Parameters
        ----------
        record : Dataset
            Inputs, and the output of the warm-up; averaged as in `simulate`.
        level : float
            Probability, between 0.5 and 0.99.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors in `metrics`.

        Raises
        ------
        ModelError
            The free runs of the model diverged on the data that calibrate the bands.
        SettingsError
            The level is out of range.
        """
        bands = self.ranked_model.bands
        if bands is None:
            raise ModelError(
                f"model {self.rank} has no prediction bands: its free run diverged, take another"
            )
        warm_up = self.ranked_model.assessment.warm_up if warm_up is None else warm_up
        return bands.predict(self.model, match_rate(self.model, record), level, warm_up)

    @property
    def least_squares_bias(self) -> float | None:
        """Largest bias of least squares for this structure, in standard errors; None if it is unknown.

        Above 2 to 3 the noise is coloured or a term is missing: take another entry of ``ESTIMATORS``. The
        estimation runs at each access.
        """
        result = self.search_result
        found = least_squares_bias(self.model, result.split.estimation, str(result.settings["constraints"]))
        return None if isinstance(found, EvaluationOutcome) else found

    def plot(self, kind: str = "free-run") -> "Figure":
        """Draw a figure of the model; ``kind`` is a key of ``islands.figures.registry.FIGURES``."""
        # matplotlib takes half a second to import, which every process of a cluster would pay.
        from islands.figures.registry import FIGURES  # noqa: PLC0415

        return lookup(FIGURES, kind, "figure")(self.ranked_model, self.search_result.split)

    def export(self, kind: str = "python") -> str:
        """Return the model as text: plain, latex, mathml, python, c, matlab or json."""
        return export(self.model, kind)

    def __str__(self) -> str:
        return self.equation

    def __repr__(self) -> str:
        return f"<FittedModel of rank {self.rank}: {self.equation}>"

    def _repr_html_(self) -> str:
        error, unit = self.metrics["validation"]["free_run"].rmse, self.search_result.record.output_unit
        sentence = f"Rank {self.rank}: free-run RMSE on the validation data {error:.4g} {unit}".rstrip()
        return render_html(self.model, [sentence], self.plot())


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Result of a search."""

    search_result: SearchResult

    @property
    def models(self) -> tuple[FittedModel, ...]:
        """All models, in the order of their free-run error on the validation data."""
        return tuple(
            FittedModel(rank, entry, self.search_result)
            for rank, entry in enumerate(self.search_result.models, start=1)
        )

    @property
    def best(self) -> FittedModel:
        """Recommended model: the smallest one that is as good as the one with the least validation error.

        ``result.models[0]`` has the least free-run error on the validation data.
        """
        return self.models[self.recommendation.rank - 1]

    @property
    def recommendation(self) -> Recommendation:
        """Rank of the recommended model, and the reasons for the choice."""
        return self.search_result.recommendation

    def with_wall_time(self, seconds: float) -> "Result":
        """Return a copy of the result with the duration of the search in seconds."""
        return Result(replace(self.search_result, search=replace(self.search_result.search, wall_s=seconds)))

    def save(self, folder: str | Path) -> Path:
        """Write ``result.json``, ``models/``, ``figures/`` (of the recommended model) and ``summary.txt``."""
        from islands.figures.registry import SEARCH_FIGURES, model_figures, search_figures  # noqa: PLC0415
        from islands.figures.style import save  # noqa: PLC0415

        folder = Path(folder)
        figures = folder / "figures"
        figures.mkdir(parents=True, exist_ok=True)
        # An earlier result in the folder may have had a loop.
        (figures / "loop.svg").unlink(missing_ok=True)
        for kind in model_figures(self.search_result):
            save(self.best.plot(kind), figures / f"{kind}.svg")
        for name in search_figures(self.search_result):
            save(SEARCH_FIGURES[name](self.search_result), figures / f"{name}.svg")
        write_result(self.search_result, folder)
        return folder

    def __str__(self) -> str:
        return summary(self.search_result)

    def __repr__(self) -> str:
        models = len(self.search_result.models)
        return f"<Result of {models} model{'s' * (models > 1)}, recommended: {self.best.equation}>"

    def _repr_html_(self) -> str:
        # The equation, which is indented, is shown in MathML.
        sentences = [line for line in describe(self.search_result) if not line.startswith(" ")]
        return render_html(self.best.model, sentences, self.best.plot())


def simulate(
    model: "Model | str | Mapping[str, Any] | SimulationSpec | LocalSpec",
    record: Dataset,
    mode: str = "free-run",
    shooting: int = 500,
    columns: Mapping[str, Any] | None = None,
    warm_up: int | None = None,
) -> Simulation:
    """Simulate a record.

    Parameters
    ----------
    model : Model, str, mapping or spec
        A model; or a simulator, as its name on the command line (``second-order``), its specification, or
        the document of an extended simulation.
    record : Dataset
        Inputs, and the output from which initial states are taken. Its samples are averaged if the model
        describes means of samples and the record has the sampling time before averaging (see `match_rate`).
    mode : str
        ``one-step``, ``shooting`` (intervals of ``shooting`` samples) or ``free-run``; a simulator has
        ``free-run`` only.
    shooting : int
        Steps of the model in each interval; a step of a model of means is a mean.
    columns : mapping, optional
        Recorded simulations by name for the simulator ``column:NAME``, each of shape (samples,).
    warm_up : int, optional
        Number of samples before the first prediction of a model; by default the model's largest lag.

    Raises
    ------
    RecordError
        The record does not match the model, or is too short.
    SettingsError
        The mode or the simulator is unknown, or the warm-up is shorter than the model's largest lag.
    """
    intervals = dict(zip(SIMULATION_MODES, (1, shooting, None), strict=True))
    interval = lookup(intervals, mode, "mode")
    if isinstance(model, Model):
        return multiple_shooting(model, match_rate(model, record), interval, warm_up)
    if interval is not None:
        raise SettingsError(f"a simulator has no mode {mode!r}: take free-run")
    # Import the simulators of the discrepancy analysis only if they are used.
    from islands.io.simulator_spec.factory import simulate_spec  # noqa: PLC0415

    y = simulate_spec(model, record, columns)
    return Simulation(y, float(np.mean((record.y - y) ** 2)), EvaluationOutcome())
