"""Result objects: what a user holds after a fit, with the verbs that belong to it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from islands.data.dataset import Dataset
from islands.errors import lookup
from islands.evolution.search_result import RankedModel, SearchResult
from islands.io.export import export
from islands.io.result_folder import summary, write_result
from islands.model.equations import equation, latex_equation
from islands.model.model import Model
from islands.simulation.predictors import Simulation, multiple_shooting
from islands.validation.metrics import Metrics
from islands.validation.physics import PhysicsChecks
from islands.validation.residual_tests import ResidualTests

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: How a model may be simulated, by the names of the command line.
SIMULATIONS = ("one-step", "shooting", "free-run")


@dataclass(frozen=True, slots=True, eq=False)
class FittedModel:
    """One model of a result.

    Attributes
    ----------
    rank : int
        1 is the best.
    ranked_model : RankedModel
        The model, and its errors, residual tests and physics.
    search_result : SearchResult
        The result that it belongs to.
    """

    rank: int
    ranked_model: RankedModel
    search_result: SearchResult

    @property
    def model(self) -> Model:
        """The model itself: regressors, parameters, standard errors."""
        return self.ranked_model.model

    @property
    def equation(self) -> str:
        """The equation as plain text."""
        return equation(self.model)

    @property
    def latex(self) -> str:
        """The equation in LaTeX."""
        return latex_equation(self.model)

    @property
    def metrics(self) -> Mapping[str, Mapping[str, Metrics]]:
        """``metrics["validation"]["free_run"].mape``, and so on."""
        return self.ranked_model.assessment.metrics

    @property
    def physics(self) -> PhysicsChecks:
        """Cluster sums, holds, minor loops, other amplitudes and rates."""
        return self.ranked_model.assessment.physics

    @property
    def residual_tests(self) -> ResidualTests:
        """The correlation tests of the one-step-ahead residual."""
        return self.ranked_model.assessment.residual_tests

    def simulate(self, record: Dataset, mode: str = "free-run") -> Simulation:
        """Simulate the model on a record; ``mode`` is one-step, shooting or free-run."""
        return simulate(self.model, record, mode, int(self.search_result.settings["shooting"]))

    def plot(self, kind: str = "free-run") -> "Figure":
        """Draw a figure of the model on the validation data: one of ``islands.figures.registry.FIGURES``."""
        # Drawing takes half a second to import, and every process of a cluster would wait for it.
        from islands.figures.registry import FIGURES  # noqa: PLC0415

        return lookup(FIGURES, kind, "figure")(self.ranked_model, self.search_result.split)

    def export(self, kind: str = "python") -> str:
        """Return the model as text: plain, latex, mathml, python, c, matlab or json."""
        return export(self.model, kind)

    def __str__(self) -> str:
        return self.equation


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """What a search found; models come best first."""

    search_result: SearchResult

    @property
    def models(self) -> tuple[FittedModel, ...]:
        """All models, best first."""
        return tuple(
            FittedModel(rank, entry, self.search_result)
            for rank, entry in enumerate(self.search_result.models, start=1)
        )

    @property
    def best(self) -> FittedModel:
        """The model with the least free-run error on the validation data."""
        return self.models[0]

    def with_wall_time(self, seconds: float) -> "Result":
        """Return the result with the time that the search took, for whoever has a clock."""
        return Result(replace(self.search_result, search=replace(self.search_result.search, wall_s=seconds)))

    def save(self, folder: str | Path) -> Path:
        """Write ``result.json``, ``models/``, ``figures/`` (of the best model) and ``summary.txt``."""
        from islands.figures.registry import FIGURES, SEARCH_FIGURES, search_figures  # noqa: PLC0415
        from islands.figures.style import save  # noqa: PLC0415

        folder = Path(folder)
        figures = folder / "figures"
        figures.mkdir(parents=True, exist_ok=True)
        for kind in FIGURES:
            save(self.best.plot(kind), figures / f"{kind}.svg")
        for name in search_figures(self.search_result):
            save(SEARCH_FIGURES[name](self.search_result), figures / f"{name}.svg")
        write_result(self.search_result, folder)
        return folder

    def __str__(self) -> str:
        return summary(self.search_result)


def simulate(model: Model, record: Dataset, mode: str = "free-run", shooting: int = 500) -> Simulation:
    """Simulate a model on a record.

    Parameters
    ----------
    mode : str
        ``one-step``, ``shooting`` (intervals of ``shooting`` samples) or ``free-run``.

    Raises
    ------
    SettingsError
        The mode is unknown.
    """
    intervals = dict(zip(SIMULATIONS, (1, shooting, None), strict=True))
    return multiple_shooting(model, record, lookup(intervals, mode, "mode"))
