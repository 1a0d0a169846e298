"""Free runs of the models of a job, as numbers for a screen."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.facade.results.model_simulation import match_columns
from islands.models.coupled_narx import AnyModel
from islands.models.protocol import DynamicModel
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run
from islands.validation.prediction_bands import AnyBands, PredictionBand
from islands_service.domain.job import name_free_run_artefacts
from islands_service.domain.plot_envelopes import describe_envelopes

#: Largest number of samples of a free run that is returned as numbers: a screen shows no more.
MAX_POINTS = 4000

#: Largest number of parts of the free run of a running search, which is sent often.
SEARCH_POINTS = 500

#: Significant digits of such a free run.
_DIGITS = 6


@dataclass(frozen=True, slots=True, eq=False)
class SearchFreeRun:
    """Free run of the best model so far of a search.

    Attributes
    ----------
    generation : int
        Generation of the search.
    size : int
        Size of the model.
    document : mapping
        Fields of `islands_api.result_schemas.SearchFreeRunView`, without the job.
    """

    generation: int
    size: int
    document: Mapping[str, Any]

    @property
    def mark(self) -> dict[str, int]:
        """What the progress of the job states about it."""
        return {"size": self.size, "generation": self.generation}


def simulate_searched(
    model: DynamicModel, size: int, data: Dataset, offset: float, generation: int, error: float
) -> SearchFreeRun:
    """Simulate a model of a running search over its estimation data, from the measured first outputs.

    Parameters
    ----------
    model : DynamicModel
    size : int
        Size of the model in the search.
    data : Dataset
    offset : float
        Constant that was subtracted from the output of ``data``.
    generation : int
        Generation of the search.
    error : float
        Error of the model in the search.
    """
    run = free_run(model, data)
    signals = {"measured": data.y + offset, "free_run": run.y + offset}
    rows, columns = describe_envelopes(signals, 0, SEARCH_POINTS)
    document = {
        "output": data.output_name,
        "generation": generation,
        "kind": model.kind,
        "size": size,
        "error": error,
        "outcome": str(run.outcome),
        "dt": data.dt,
        "start": data.start,
        "samples": data.samples,
        "rows": rows,
        "outputs": [
            {name: value if name == "name" else _round(value) for name, value in column.items()}
            for column in columns
        ],
    }
    return SearchFreeRun(generation, size, document)


def _round(values: Sequence[float | None]) -> list[float | None]:
    return [None if value is None else float(f"{value:.{_DIGITS}g}") for value in values]


def write_free_runs(
    model: AnyModel, bands: AnyBands | None, warm_up: int, data: AnyRecord, rank: int
) -> dict[str, bytes]:
    """Simulate a model with its bands; return the document of every output by artefact name.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    bands : PredictionBands, OutputBands or None
    warm_up : int
        Number of samples before the first prediction.
    data : Dataset or CoupledRecord
        Validation data.
    rank : int
        Rank of the model.
    """
    matched = match_columns(model, data)
    run = simulate_freely(model, matched, warm_up)
    runs = run.y.reshape(matched.samples, -1).T
    shown: Sequence[PredictionBand | None] = (None,) * len(runs)
    if bands is not None:
        shown = bands.predict(model, matched, warm_up=warm_up).outputs
    return {
        name: _write_document(each, y, run.outcome, band)
        for name, each, y, band in zip(
            name_free_run_artefacts(rank, len(runs)), matched.records, runs, shown, strict=True
        )
    }


def _write_document(
    data: Dataset, simulated: NDArray[np.float64], outcome: EvaluationOutcome, band: PredictionBand | None
) -> bytes:
    """Return the validation data and a free run of one output as JSON, downsampled to `MAX_POINTS`."""
    every = max(1, -(-data.samples // MAX_POINTS))
    kept = slice(None, None, every)
    time = data.start + data.dt * np.arange(data.samples)
    document = {
        "outcome": str(outcome),
        "every": every,
        "time_s": time[kept].tolist(),
        "inputs": {name: data.u[kept, index].tolist() for index, name in enumerate(data.input_names)},
        "measured": data.y[kept].tolist(),
        "free_run": _finite_values(simulated[kept]),
    }
    if band is not None:
        document["band"] = {
            "level": band.level,
            "lower": _finite_values(band.lower[kept]),
            "upper": _finite_values(band.upper[kept]),
        }
    return json.dumps(document).encode()


def _finite_values(values: NDArray[np.float64]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]
