"""`AssessedModel`: what a model of a result offers, whether the result is new or read from a folder."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.data.dataset import Dataset
from islands.data.signal_map import match_rate
from islands.errors import ModelError
from islands.facade.results.model_analysis import AnalysedModel
from islands.facade.results.model_simulation import predict, record_of_model, simulate
from islands.facade.results.notebook_html import render_html
from islands.io.export import export, write_export
from islands.simulation.predictors import Simulation
from islands.validation.metrics import Metrics
from islands.validation.prediction_bands import LEVEL, PredictionBand, PredictionBands

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from narwhals.typing import IntoSeries

    from islands.io.data_frames import RecordLike


class AssessedModel(AnalysedModel, ABC):
    """A model with its rank, its errors, and the settings of the simulations that measured them.

    Attributes
    ----------
    rank : int or None
        Rank of the model; 1 has the least validation error. None outside of a result.
    model : Model
        Regressors, parameters, standard errors.
    metrics : mapping
        Errors by part and prediction, for example ``metrics["validation"]["free_run"].mape``.
    warm_up : int
        Number of samples before the first prediction of the simulations of ``metrics``.
    shooting_interval : int
        Steps of the model in each interval of multiple shooting.
    prediction_bands : PredictionBands or None
        Prediction bands of every level; None if the free run of the model diverged.
    output_unit : str
        Unit of the output; empty if unknown.
    """

    __slots__ = ()

    # Declared only, as in `AnalysedModel`.
    if TYPE_CHECKING:

        @property
        def rank(self) -> int | None:
            """Rank of the model."""

        @property
        def metrics(self) -> Mapping[str, Mapping[str, Metrics]]:
            """Errors by part and prediction."""

        @property
        def warm_up(self) -> int:
            """Samples before the first prediction."""

        @property
        def shooting_interval(self) -> int:
            """Steps in an interval of multiple shooting."""

        @property
        def prediction_bands(self) -> PredictionBands | None:
            """Prediction bands of every level."""

    @property
    @abstractmethod
    def validation(self) -> Dataset:
        """Validation data of the search.

        Raises
        ------
        ModelError
            The result was read from a folder, which has no data.
        """

    def predict(
        self,
        record: "RecordLike",
        y: "ArrayLike | IntoSeries | None" = None,
        dt: float | None = None,
        *,
        inputs: str | Sequence[str] = (),
        output: str | None = None,
    ) -> NDArray[np.float64]:
        """Return the free run of the model, one value for every row of the data.

        It starts from the first samples of the output, as many as the largest lag of the model. `simulate`
        starts later, after the warm-up of `metrics`.

        Parameters
        ----------
        record : Dataset, data frame or array
            Inputs, and the output, of which only the first samples are used; the rest may be missing.
        y, dt, inputs, output
            As in `as_record`. By default the columns and the sampling time are those of the model.

        Returns
        -------
        ndarray, shape (samples,)
            Each row of a model of means has the prediction of its mean. NaN during the warm-up of every
            segment and after a divergence.

        Raises
        ------
        RecordError
            The data do not match the model (the message lists the columns), are too short, or the output is
            missing in the warm-up.
        """
        data = record_of_model(self.model, record, y, dt, inputs, output)
        return predict(self.model, data)

    def simulate(
        self,
        record: "RecordLike",
        mode: str = "free-run",
        warm_up: int | None = None,
        shooting: int | None = None,
    ) -> Simulation:
        """Simulate the model on a record.

        On the validation data, the errors of the simulation are those in `metrics`.

        Parameters
        ----------
        record : Dataset or data frame
            Its samples are averaged as in the search if it has the sampling time of the search's record.
        mode : str
            ``one-step``, ``shooting`` or ``free-run``.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors in `metrics`.
        shooting : int, optional
            Steps of the model in each shooting interval; by default those of the errors in `metrics`.
        """
        warm_up = self.warm_up if warm_up is None else warm_up
        shooting = self.shooting_interval if shooting is None else shooting
        return simulate(self.model, record, mode, shooting, warm_up=warm_up)

    def bands(self, record: "RecordLike", level: float = LEVEL, warm_up: int | None = None) -> PredictionBand:
        """Simulate the model on a record, with a band that contains a measured sample with a probability.

        Parameters
        ----------
        record : Dataset or data frame
            Inputs, and the output of the warm-up; averaged as in `simulate`.
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
            raise ModelError("prediction bands need a model of a result folder: give its folder or file")
        if self.prediction_bands is None:
            raise ModelError(
                f"model {self.rank} has no prediction bands: its free run diverged, or the search was "
                "stopped before them or is of an earlier version. Take another model"
            )
        warm_up = self.warm_up if warm_up is None else warm_up
        data = match_rate(self.model, record_of_model(self.model, record))
        return self.prediction_bands.predict(self.model, data, level, warm_up)

    def plot(
        self, kind: str = "free-run", record: "RecordLike | None" = None, *, ax: "Axes | None" = None
    ) -> "Figure":
        """Draw a figure of the model.

        Parameters
        ----------
        kind : str
            A key of ``islands.figures.registry.FIGURES``: ``free-run`` (or ``free_run``, as in ``metrics``),
            ``loop``, ``hold``, ``residuals``, ...
        record : Dataset or data frame, optional
            Record that is drawn; by default the validation data. A frame has the columns of the model.
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
            The result was read from a folder without the record, and no record is given.
        """
        # matplotlib takes half a second to import, which every process of a cluster would pay.
        from islands.figures.registry import draw_record_figure  # noqa: PLC0415

        kind = kind.replace("_", "-")
        if record is None and ax is None:
            return self._draw(kind)
        if record is None:
            data = self.validation
        else:
            data = match_rate(self.model, record_of_model(self.model, record))
        return draw_record_figure(kind, self.model, data, self.warm_up, self.prediction_bands, ax)

    @abstractmethod
    def _draw(self, kind: str) -> "Figure":
        """Draw a figure of the assessment."""

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the model as text, or write it to a file.

        Parameters
        ----------
        kind : str
            plain, latex, mathml, python, c, matlab or json; with a path also fmu (FMI 3.0) or fmu2.
        path : str or Path, optional
            File to write; nothing is returned then.

        Raises
        ------
        SettingsError
            The format is unknown, or is not text and no path is given.
        """
        if path is None:
            return export(self.model, kind)
        write_export(self.model, kind, path)
        return None

    def __str__(self) -> str:
        return self.equation

    def __repr__(self) -> str:
        rank = "" if self.rank is None else f" of rank {self.rank}"
        return f"<{type(self).__name__}{rank}: {self.equation}>"

    def _repr_html_(self) -> str:
        return render_html(self.model, [self.describe_error()], self.plot())

    def describe_error(self) -> str:
        """Return the rank and the error of the model as a sentence."""
        error = self.metrics["validation"]["free_run"].rmse
        text = f"Rank {self.rank}: free-run RMSE on the validation data {error:.4g} {self.output_unit}"
        return text.rstrip()
