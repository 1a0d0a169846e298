"""Comparison of two results: a table of the recommended models, and the errors of all models."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from html import escape
from math import isfinite, nan
from typing import TYPE_CHECKING

from islands.errors import SettingsError
from islands.facade.results.fitted_model import FittedModel, list_metrics
from islands.facade.results.model_simulation import match_columns, record_of_model
from islands.models.coupled_narx import list_models
from islands.report.text.facts import BEFORE_REFIT
from islands.validation.metrics import Metrics, metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from islands.records.reading.data_frames import RecordLike


@dataclass(frozen=True, slots=True)
class ComparisonRow:
    """One row of a comparison.

    Attributes
    ----------
    result : str
        Name of the result.
    output : str
        Name of the output.
    rank, terms : int
    rmse, mape, r2 : float
        Errors in free run: in the unit of the output, in per cent of the output range, and R2. NaN after a
        divergence.
    equation : str
    """

    result: str
    output: str
    rank: int
    terms: int
    rmse: float
    mape: float
    r2: float
    equation: str

    @property
    def name(self) -> str:
        """Name of the result and of the output."""
        return f"{self.result}, {self.output}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ResultComparison:
    """Recommended models of two results, and the errors of all their models.

    Attributes
    ----------
    recommended : tuple of ComparisonRow
        Recommended model of each result, a row for each output.
    models : tuple of ComparisonRow
        All models of both results.
    data : str
        What the errors were measured on.
    """

    recommended: tuple[ComparisonRow, ...]
    models: tuple[ComparisonRow, ...]
    data: str

    def plot(self, *, ax: "Axes | None" = None) -> "Figure":
        """Draw the RMSE of the free run of all models over their number of terms, by result.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw into.
        """
        from islands.report.figures.convergence import draw_fronts  # noqa: PLC0415

        names = dict.fromkeys(each.name for each in self.models)
        fronts = {
            name: [(each.terms, each.rmse) for each in self.models if each.name == name] for name in names
        }
        marked = {each.name: (each.terms, each.rmse) for each in self.recommended}
        return draw_fronts(fronts, marked, self.data, ax)

    def __str__(self) -> str:
        lines = [*self._cells()]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        rows = ("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)
        return "\n".join([f"Errors in free run on {self.data}", *rows])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        from islands.report.figures.style import image_html  # noqa: PLC0415

        head, *rows = (
            "".join(f'<t{kind} style="text-align: left">{escape(cell)}</t{kind}>' for cell in line)
            for kind, line in zip("h" + "d" * len(self.recommended), self._cells(), strict=True)
        )
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        sentence = f"<p>Errors in free run on {escape(self.data)}</p>"
        return f"<div>{sentence}{table}{image_html(self.plot(), 'error over the number of terms')}</div>"

    def _cells(self) -> list[list[str]]:
        head = [each.name for each in fields(ComparisonRow)]
        return [head, *([_write(getattr(row, name)) for name in head] for row in self.recommended)]


def _write(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.5g}" if isfinite(value) else "diverged"


def compare_models(
    results: Sequence[Sequence[FittedModel]],
    chosen: Sequence[int],
    names: Sequence[str],
    same_data: bool,
    record: "RecordLike | None",
) -> ResultComparison:
    """Compare the models of two results.

    Parameters
    ----------
    results : sequence of sequence of FittedModel
        Models by rank, of each result.
    chosen : sequence of int
        Rank of the recommended model of each result.
    names : sequence of str
        Names of the results.
    same_data : bool
        Whether both results have the same validation data.
    record : Dataset or data frame, optional
        Record that all models simulate, in place of the validation data.

    Raises
    ------
    SettingsError
        The names are not two different ones.
    RecordError
        The record does not match a model.
    """
    if len(set(names)) != len(results):
        raise SettingsError(f"two results need two different names, got {', '.join(names)}")
    rows = [
        [_list_rows(name, rank, each, record) for rank, each in enumerate(models, start=1)]
        for name, models in zip(names, results, strict=True)
    ]
    data = "the given record"
    if record is None:
        data = "the validation data"
        if not same_data:
            data += " of each result, which differ: give a record to compare on"
        if any(each.is_refitted for models in results for each in models):
            data += f" ({BEFORE_REFIT})"
    recommended = (row for rank, models in zip(chosen, rows, strict=True) for row in models[rank - 1])
    every = (row for models in rows for model in models for row in model)
    return ResultComparison(tuple(recommended), tuple(every), data)


def _list_rows(name: str, rank: int, entry: FittedModel, record: "RecordLike | None") -> list[ComparisonRow]:
    """Return the row of every output of a model."""
    if record is None:
        found = [errors["validation"]["free_run"] for errors in list_metrics(entry.metrics).values()]
    else:
        data = match_columns(entry.model, record_of_model(entry.model, record))
        run = entry.simulate(data)
        runs = run.y.reshape(data.samples, -1).T
        found = [
            metrics(each.y, y) if run.outcome else Metrics(nan, nan, nan, nan)
            for each, y in zip(data.records, runs, strict=True)
        ]
    return [
        ComparisonRow(
            *(name, single.output_name, rank, single.size, errors.rmse, errors.mape, errors.r2),
            "; ".join(single.equation().named.splitlines()),
        )
        for single, errors in zip(list_models(entry.model), found, strict=True)
    ]
