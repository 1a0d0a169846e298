"""Errors of a model on test data, which no search has used."""

import json
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import islands
from islands.cli.console import output
from islands.facade.results.model_simulation import match_columns
from islands.records.coupled import AnyRecord
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.metrics import metrics

#: File of the metrics on the test data.
TEST = "test.json"


def evaluate_test(result: islands.Result, test_data: AnyRecord, folder: Path) -> None:
    """Simulate the test data with the recommended model; print and write the metrics of each output."""
    data = match_columns(result.best.model, test_data)
    run = result.simulate(data)
    pairs = zip(data.records, run.y.reshape(data.samples, -1).T, strict=True)
    found = [(each.output_name, *_compute_errors(each, y, run.outcome)) for each, y in pairs]
    document: dict[str, Any] = {"outcome": str(run.outcome)}
    if len(found) == 1:
        ((_, numbers, text),) = found
        document |= numbers
    else:
        document["outputs"] = [{"name": name, **numbers} for name, numbers, _ in found]
        text = "".join(f"\n  {name}{text.replace(',', ':', 1)}" for name, _, text in found if text)
    (folder / TEST).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    output.print(f"test data, not used before: free run {run.outcome}{text}", markup=False)


def _compute_errors(
    record: islands.Dataset, y: NDArray[np.float64], outcome: EvaluationOutcome
) -> tuple[dict[str, float | None], str]:
    """Return the metrics of a simulation as JSON values and as text; both are empty after a divergence."""
    if not outcome:
        return {}, ""
    found = metrics(record.y, y)
    numbers = {name: value if isfinite(value) else None for name, value in asdict(found).items()}
    text = f", MAPE {found.mape:.4f} %, R2 {found.r2:.5f}, RMSE {found.rmse:.6g} {record.output_unit}"
    return numbers, text.rstrip()
