"""`RankedModels`: what a result offers, whether it is new or read from a folder."""

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError
from islands.facade.results.assessed_model import AssessedModel
from islands.facade.results.result_comparison import ResultComparison, compare_models
from islands.simulation.predictors import Simulation
from islands.validation.recommendation import Recommendation

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from narwhals.typing import IntoSeries

    from islands.io.data_frames import RecordLike

M = TypeVar("M", bound=AssessedModel)


class RankedModels(ABC, Generic[M]):
    """Models in the order of their free-run error on the validation data, one of them recommended.

    Attributes
    ----------
    models : tuple
        All models, in that order.
    recommendation : Recommendation
        Rank of the recommended model, and the reasons for the choice.
    """

    __slots__ = ()

    # Declared only, as in `AnalysedModel`.
    if TYPE_CHECKING:

        @property
        def models(self) -> tuple[M, ...]:
            """All models by rank."""

        @property
        def recommendation(self) -> Recommendation:
            """Recommended model."""

    @property
    @abstractmethod
    def validation_key(self) -> str:
        """Text that identifies the validation data."""

    @property
    def best(self) -> M:
        """Recommended model: the smallest one that is as good as the one with the least validation error.

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
        output: str | None = None,
    ) -> NDArray[np.float64]:
        """Return the free run of the recommended model; see `AssessedModel.predict`."""
        return self.best.predict(record, y, dt, inputs=inputs, output=output)

    def simulate(
        self,
        record: "RecordLike",
        mode: str = "free-run",
        warm_up: int | None = None,
        shooting: int | None = None,
    ) -> Simulation:
        """Simulate a record with the recommended model; see `AssessedModel.simulate`."""
        return self.best.simulate(record, mode, warm_up, shooting)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the recommended model as text, or write it to a file; see `AssessedModel.export`."""
        return self.best.export(kind, path)

    def plot(
        self, kind: str = "free-run", record: "RecordLike | None" = None, *, ax: "Axes | None" = None
    ) -> "Figure":
        """Draw a figure of the recommended model; see `AssessedModel.plot`."""
        return self.best.plot(kind, record, ax=ax)

    def compare(
        self,
        other: "RankedModels[Any]",
        record: "RecordLike | None" = None,
        names: Sequence[str] = ("this", "other"),
    ) -> ResultComparison:
        """Compare the models with those of another result.

        Parameters
        ----------
        other : Result or SavedResult
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
        both = (self, other)
        return compare_models(
            [each.models for each in both],
            [each.recommendation.rank for each in both],
            names,
            self.validation_key == other.validation_key,
            record,
        )

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with one row per model, by rank.

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
        rows = [_row(each, each.rank == self.recommendation.rank) for each in self.models]
        return pandas.DataFrame(rows).set_index("rank")

    def __repr__(self) -> str:
        models = len(self.models)
        name = type(self).__name__
        return f"<{name} of {models} model{'s' * (models > 1)}, recommended: {self.best.equation}>"


def _row(entry: AssessedModel, recommended: bool) -> dict[str, object]:
    parts = {"est": "estimation", "val": "validation"}
    errors = {
        f"{name}_{short}": getattr(entry.metrics[part]["free_run"], name)
        for short, part in parts.items()
        for name in ("rmse", "mape", "r2")
    }
    one_step = entry.metrics["validation"]["one_step_ahead"].rmse
    return {
        "rank": entry.rank,
        "recommended": recommended,
        "terms": entry.model.size,
        **errors,
        "one_step_rmse_val": one_step,
        "equation": entry.equation,
    }


def write_validation_key(sha256: str, settings: Mapping[str, Any], average: int) -> str:
    """Return the text that identifies validation data: the record, their part of it, and the means."""
    return json.dumps([sha256, settings["validation"], average], sort_keys=True)
