"""Assessment of a model of several outputs: the errors and the residual of each in the common free run."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import nan

import numpy as np
from numpy.typing import NDArray

from islands.models.coupled_narx import CoupledModel
from islands.records.coupled import CoupledRecord, CoupledSplit
from islands.simulation.predictors import free_run, one_step_ahead
from islands.validation.assessment import PARTS
from islands.validation.evidence import mean_square, measure_errors
from islands.validation.metrics import Metrics, metrics
from islands.validation.predictable_residual import ResidualStructure, measure_structure
from islands.validation.prediction_bands import OutputBands


@dataclass(frozen=True, eq=False)
class CoupledAssessment:
    """A model of several outputs with the errors of the common free run.

    Attributes
    ----------
    model : CoupledModel
    split : CoupledSplit
        Estimation data and validation data with the sampling time of the model.
    warm_up : int
        Number of samples before the first prediction. The errors depend on it.
    refined : bool
        Whether the parameters were refined on the common free run. If not, they are those of separate
        searches.
    ranks : tuple of int
        Rank of the model of each output in its separate search; empty if all outputs have one search.
    structure : str
        What the model consists of: ``a state space of 4 shared states``.
    size : float
        Number of parameters that have an effect, as of `measure_size`.
    bands : OutputBands or None
        Prediction bands of every output. None if the free run of the model diverges, or the search was
        stopped before them.
    """

    model: CoupledModel
    split: CoupledSplit
    warm_up: int
    refined: bool
    ranks: tuple[int, ...]
    structure: str
    size: float
    bands: OutputBands | None = None

    @property
    def final_model(self) -> CoupledModel:
        """The model itself: several outputs have no refit."""
        return self.model

    @cached_property
    def metrics(self) -> Mapping[str, Mapping[str, Mapping[str, Metrics]]]:
        """Errors by output, part and prediction: ``metrics["y1"]["validation"]["free_run"].rmse``.

        The free run is that of all equations together; one step ahead, all outputs are measured. NaN if the
        simulation diverged.
        """
        parts = {part: self._measure(getattr(self.split, part)) for part in PARTS}
        return {
            name: {part: errors[place] for part, errors in parts.items()}
            for place, name in enumerate(self.model.output_names)
        }

    def _measure(self, record: CoupledRecord) -> list[dict[str, Metrics]]:
        """Return the errors of every output on a part of the data."""
        free, found = free_run(self.model, record, self.warm_up), []
        for place, (data, single) in enumerate(zip(record.records, self.model.models, strict=True)):
            one = one_step_ahead(single, self.model.separate(record, place), self.warm_up)
            runs = {"one_step_ahead": (one.y, one.outcome), "free_run": (free.y[:, place], free.outcome)}
            found.append(
                {mode: metrics(data.y, y if outcome else y * nan) for mode, (y, outcome) in runs.items()}
            )
        return found

    @cached_property
    def errors(self) -> NDArray[np.float64]:
        """Errors of the common free runs on both parts of the data; see `join_errors`."""
        return measure_errors(self.model, self.split, self.warm_up)

    @property
    def validation_error(self) -> float:
        """Root mean square of the errors on the validation data; infinite after a divergence."""
        return float(np.sqrt(np.nanmean(self.errors[self.split.estimation.samples :] ** 2)))

    @property
    def mean_square(self) -> float:
        """Geometric mean over the outputs of the mean squared error of the common free run on all data."""
        return mean_square(self.errors)

    def measure_residual(self, place: int) -> ResidualStructure:
        """Measure the residuals of an output on the longest recording of the validation data."""
        data = self.split.validation
        first, last = max(data.bounds, key=lambda bounds: bounds[1] - bounds[0])
        recording = data.map(lambda each: each[first:last])
        record, warm_up = recording.records[place], self.warm_up
        one = one_step_ahead(self.model.models[place], self.model.separate(recording, place), warm_up)
        free = free_run(self.model, recording, warm_up)
        one_step, simulated = (
            (record.y - y)[warm_up:] if outcome else None
            for y, outcome in ((one.y, one.outcome), (free.y[:, place], free.outcome))
        )
        return measure_structure(
            one_step, simulated, record.u[warm_up:], record.y[warm_up:], data.records[place].output_range
        )
