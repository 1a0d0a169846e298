"""`Result` of `fit` and `identify`, new or read from a folder."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError, SettingsError, check_type
from islands.evolution.search_result import AnySearchResult, CoupledSearchResult, state_steps
from islands.facade.results.comparison import ResultComparison, compare_models
from islands.facade.results.fitted_model import FittedModel, list_metrics
from islands.facade.results.notebook_html import render_html
from islands.models.coupled_narx import list_models
from islands.models.state_space import StateSpace
from islands.progress import Steps
from islands.report.documents.result_folder import (
    content_sha256,
    list_folders,
    result_document,
    write_result,
)
from islands.report.figures.names import FREE_RUN, LINEAR_FIGURES, OVERVIEW, RESPONSES, name_free_runs
from islands.report.pages.origin import REPORT_FILE
from islands.report.text.statements import describe
from islands.report.text.summary import summary
from islands.simulation.predictors import Simulation
from islands.simulation.stepper import Stepper
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.metrics import Metrics
from islands.validation.prediction_bands import LEVEL, PredictionBand
from islands.validation.recommendation import Recommendation

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from narwhals.typing import IntoSeries

    from islands.models.linearisation import OperatingPoint
    from islands.records.reading.data_frames import RecordLike


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Result:
    """Result of a search, new or read from a folder.

    Attributes
    ----------
    models : tuple of FittedModel
        All models, in the order of their free-run error on the validation data.
    recommendation : Recommendation
        Rank of the recommended model, and the reasons for the choice.
    settings : mapping
        Settings that determine the result, together with the record and the seed.
    outputs : tuple of Result
        Separate result of every output, of several outputs that were searched one by one; otherwise empty.
    folder : Path or None
        Folder that the result was read from; None for a new result.
    document : mapping
        Content of the ``result.json`` of this folder: record, settings, statistics of the search, models.
        Empty for a new result.
    """

    models: tuple[FittedModel, ...]
    recommendation: Recommendation
    settings: Mapping[str, Any]
    outputs: tuple["Result", ...] = ()
    folder: Path | None = None
    document: Mapping[str, Any] = field(default_factory=dict)
    _search_result: AnySearchResult | None = None

    @classmethod
    def from_search(cls, found: AnySearchResult) -> "Result":
        """Return the result of a search."""
        entries: Sequence[Assessment | CoupledAssessment] = found.models
        models = tuple(
            FittedModel.from_search(rank, entry, found) for rank, entry in enumerate(entries, start=1)
        )
        outputs = found.outputs if isinstance(found, CoupledSearchResult) else ()
        separate = tuple(map(cls.from_search, outputs))
        return cls(models, found.recommendation, found.settings, separate, _search_result=found)

    @property
    def search_result(self) -> AnySearchResult:
        """Record, split and statistics of the search.

        Raises
        ------
        ModelError
            The result was read from a folder.
        """
        if self._search_result is None:
            raise ModelError(f"{self.folder} has no data of its search: read `document`, or search again")
        return self._search_result

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.best.output_names

    @property
    def best(self) -> FittedModel:
        """Recommended model: the simplest one with the most evidence.

        ``result.models[0]`` has the least free-run error on the validation data.
        """
        return self.models[self.recommendation.rank - 1]

    def predict(
        self,
        record: "RecordLike",
        y: "ArrayLike | IntoSeries | None" = None,
        dt: float | None = None,
        *,
        inputs: str | Sequence[str] = (),
        output: str | Sequence[str] | None = None,
    ) -> NDArray[np.float64]:
        """Return the free run of the recommended model; see `FittedModel.predict`."""
        return self.best.predict(record, y, dt, inputs=inputs, output=output)

    def simulate(
        self,
        record: "RecordLike",
        mode: str = "free-run",
        warm_up: int | None = None,
        shooting: int | None = None,
        y: ArrayLike | None = None,
        states: Sequence[float] | None = None,
    ) -> Simulation:
        """Simulate a record, or inputs alone, with the recommended model; see `FittedModel.simulate`."""
        return self.best.simulate(record, mode, warm_up, shooting, y, states)

    def stepper(
        self,
        u: "OperatingPoint | None" = None,
        y: ArrayLike | None = None,
        states: Sequence[float] | None = None,
    ) -> Stepper:
        """Return a simulation of one sample at a time; see `FittedModel.stepper`."""
        return self.best.stepper(u, y, states)

    def linearise(
        self, operating_point: "OperatingPoint | None" = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Linearise the recommended model; see `FittedModel.linearise`."""
        return self.best.linearise(operating_point, y)

    def plot_linear(
        self, kind: str = "bode", operating_point: "OperatingPoint | None" = None, y: ArrayLike | None = None
    ) -> "Figure":
        """Draw the linear system of the recommended model; see `FittedModel.plot_linear`."""
        return self.best.plot_linear(kind, operating_point, y)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the recommended model as text, or write it to a file; see `FittedModel.export`."""
        return self.best.export(kind, path)

    def bands(self, record: "RecordLike", level: float = LEVEL, warm_up: int | None = None) -> PredictionBand:
        """Simulate a record with a band about the free run; see `FittedModel.bands`."""
        return self.best.bands(record, level, warm_up)

    def plot(
        self,
        kind: str = "free-run",
        record: "RecordLike | None" = None,
        *,
        output: str | None = None,
        ax: "Axes | None" = None,
    ) -> "Figure":
        """Draw a figure of the recommended model; see `FittedModel.plot`."""
        return self.best.plot(kind, record, output=output, ax=ax)

    def compare(
        self,
        other: "Result",
        record: "RecordLike | None" = None,
        names: Sequence[str] = ("this", "other"),
    ) -> ResultComparison:
        """Compare the models with those of another result.

        Parameters
        ----------
        other : Result
        record : Dataset or data frame, optional
            Record that all models simulate. By default the errors are those on the validation data of each
            result, which are comparable if both have the same record and the same validation data.
        names : sequence of str
            Names of both results.

        Returns
        -------
        ResultComparison
            A table of the recommended models, also as HTML in a notebook, and a figure of all models
            (`ResultComparison.plot`).

        Raises
        ------
        RecordError
            The record does not match a model.
        """
        check_type(other, Result, "compare", "open a folder by islands.load(path)")
        both = (self, other)
        return compare_models(
            [each.models for each in both],
            [each.recommendation.rank for each in both],
            names,
            self.validation_key == other.validation_key,
            record,
        )

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with one row per model, by rank, and per output of several.

        Columns: whether it is recommended, its terms, its errors in free run (RMSE in the unit of the output,
        MAPE in per cent of the output range, R2) on both parts of the data and one step ahead, and its
        equation.

        Raises
        ------
        SettingsError
            pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415
        except ImportError as error:
            raise SettingsError("install pandas to get a table of the models") from error
        rows = [row for each in self.models for row in _rows(each, each.rank == self.recommendation.rank)]
        index = ["rank", "output"] if "output" in rows[0] else "rank"
        return pandas.DataFrame(rows).set_index(index)

    def __repr__(self) -> str:
        models = len(self.models)
        return f"<Result of {models} model{'s' * (models > 1)}, recommended: {self.best.equation}>"

    @property
    def left_out(self) -> tuple[str, ...]:
        """Steps that a request to stop has left out; empty for a complete result."""
        if self._search_result is None:
            return tuple(self.document["search"].get("left_out", ()))
        return self._search_result.search.left_out

    @property
    def validation_key(self) -> str:
        """Text that identifies the validation data."""
        if self._search_result is None:
            sha256, average = self.document["record"]["sha256"], self.document["preprocessing"]["average"]
        else:
            record, average = self._search_result.record.records[0], self._search_result.average
            sha256 = record.sha256 or content_sha256(record)
        return json.dumps([sha256, self.settings["validation"], average], sort_keys=True)

    def with_wall_time(self, seconds: float) -> "Result":
        """Return a copy of the result with the duration of the search in seconds."""
        found = self.search_result
        return Result.from_search(replace(found, search=replace(found.search, wall_s=seconds)))

    def save(self, folder: str | Path, steps: Steps | None = None, figures: Sequence[str] = OVERVIEW) -> Path:
        """Write ``result.json``, the models, the texts, and figures of the recommended model and the search.

        Of several outputs, the folder ``outputs/`` has a folder with the separate result of each.

        Parameters
        ----------
        folder : str or Path
        steps : Steps, optional
            The figures are optional steps, which a stop request leaves out, and whose failures the texts and
            ``result.json`` state.
        figures : sequence of str
            Names from ``islands.report.figures.names.ALL_FIGURES``. A figure that the result does not have,
            such as the loop of a record without one, is left out. Figures and a report of an earlier
            result are removed.
        """
        folder, steps, found = Path(folder), steps or Steps(), self.search_result
        folder.mkdir(parents=True, exist_ok=True)
        (folder / REPORT_FILE).unlink(missing_ok=True)
        for path in (folder / "figures").glob("*.svg"):
            path.unlink()  # of an earlier result
        write_result(found, folder)
        for name, separate in zip(list_folders(self.output_names), self.outputs, strict=False):
            own = Steps(stop=steps.stop)
            separate.save(folder / name, own, figures)
            steps.add(own.left_out, own.not_computed, separate.output_names[0])
        if figures:  # matplotlib takes half a second to load
            steps.attempt("figures", partial(self._draw_figures, folder / "figures", figures, steps))
        if steps.not_computed:
            write_result(state_steps(found, steps), folder)
        return folder

    def _draw_figures(self, folder: Path, names: Sequence[str], steps: Steps) -> None:
        from islands.report.figures.linear_system import draw_linear_system  # noqa: PLC0415
        from islands.report.figures.model_responses import draw_responses  # noqa: PLC0415
        from islands.report.figures.registry import SEARCH_FIGURES, model_figures, search_figures  # noqa: PLC0415
        from islands.report.figures.style import save  # noqa: PLC0415

        folder.mkdir(parents=True, exist_ok=True)
        found = self.search_result
        drawn: dict[str, Callable[[], Figure]] = {}
        if isinstance(found, CoupledSearchResult):
            if FREE_RUN in names:
                runs = zip(name_free_runs(len(self.output_names)), self.output_names, strict=True)
                drawn = {name: partial(self.plot, output=output) for name, output in runs}
            responses: Callable[[], dict[str, Figure]] = dict
        else:
            model = self.best.assessment.final_model
            drawn = {kind: partial(self.plot, kind) for kind in model_figures(found, model)}
            drawn |= {name: partial(SEARCH_FIGURES[name], found) for name in search_figures(found)}
            drawn = {name: draw for name, draw in drawn.items() if name in names}
            responses = partial(draw_responses, model, found.split.estimation)
        linear = [name for name in LINEAR_FIGURES if name in names]
        if linear and (system := self.best.linear_system) is not None:
            drawn |= {name: partial(draw_linear_system, system, name) for name in linear}

        def draw_one(name: str) -> None:
            save(drawn[name](), folder / f"{name}.svg")

        def draw_all_responses() -> None:
            for name, figure in responses().items():
                if name in names:
                    save(figure, folder / f"{name}.svg")

        for name in drawn:
            steps.attempt(f"figure {name}", partial(draw_one, name))
        if set(names).intersection(RESPONSES):
            steps.attempt("figures of responses", draw_all_responses)

    def report(self, path: str | Path) -> Path:
        """Write the report as one HTML file, which prints on A4; return its path.

        That of a result from a folder has the figures of the folder.
        """
        from islands.report.pages.identification import report_saved_result  # noqa: PLC0415 - loads templates

        path = Path(path)
        with TemporaryDirectory() as made:
            folder = self.folder or self.save(Path(made) / path.stem)
            path.write_bytes(report_saved_result(folder, self.best.linear_system))
        return path

    @property
    def summary(self) -> str:
        """Summary as text: verdict, errors, equation, findings and models."""
        return summary(self._describable_document(), self.best.model)

    def __str__(self) -> str:
        return self.summary

    def _repr_html_(self) -> str:
        figure = None if self._search_result is None else self.best.plot()
        # The equation, which is indented, is shown in MathML.
        sentences = [line for line in describe(self._describable_document()) if not line.startswith(" ")]
        return render_html(self.best.model, sentences, figure)

    def _describable_document(self) -> Mapping[str, Any]:
        """Return ``result.json``."""
        return self.document if self._search_result is None else result_document(self._search_result)


def _rows(entry: FittedModel, recommended: bool) -> list[dict[str, object]]:
    """Return the row of every output of a model."""
    return [
        {
            "rank": entry.rank,
            **({"output": name} if name else {}),
            "recommended": recommended,
            "terms": single.size,
            **_list_errors(found),
            "equation": single.equation().named,
        }
        for (name, found), single in zip(
            list_metrics(entry.metrics).items(), list_models(entry.model), strict=True
        )
    ]


def _list_errors(metrics: Mapping[str, Mapping[str, Metrics]]) -> dict[str, float]:
    """Return the errors of a table by column: in free run on both parts of the data, and one step ahead."""
    parts = {"est": "estimation", "val": "validation"}
    errors = {
        f"{name}_{short}": float(getattr(metrics[part]["free_run"], name))
        for short, part in parts.items()
        for name in ("rmse", "mape", "r2")
    }
    return {**errors, "one_step_rmse_val": metrics["validation"]["one_step_ahead"].rmse}
