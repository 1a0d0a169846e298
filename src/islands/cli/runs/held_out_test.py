"""Errors of a model on test data, which no search has used."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import islands
from islands.cli.console import output
from islands.records.coupled import CoupledRecord
from islands.records.signal_map import match_rate
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.metrics import metrics

#: File of the metrics on the test data.
TEST = "test.json"


def evaluate_test(
    result: islands.Result | islands.CoupledResult,
    test_data: islands.Dataset | CoupledRecord,
    folder: Path,
) -> None:
    """Simulate the test data with the recommended model; print and write the metrics of each output."""
    if isinstance(result, islands.CoupledResult):
        assert isinstance(test_data, CoupledRecord)
        records = test_data.map(partial(match_rate, result.model))
        simulated = result.simulate(records)
        entries, lines = [], []
        for record, y in zip(records.records, simulated.y.T, strict=True):
            numbers, text = _compute_errors(record, y, simulated.outcome)
            entries.append({"name": record.output_name, **numbers})
            lines += [f"\n  {record.output_name}{text.replace(',', ':', 1)}"] if text else []
        _report({"outputs": entries}, "".join(lines), simulated.outcome, folder)
    else:
        assert isinstance(test_data, islands.Dataset)
        single = match_rate(result.best.model, test_data)
        run = result.best.simulate(single)
        _report(*_compute_errors(single, run.y, run.outcome), run.outcome, folder)


def _report(numbers: Mapping[str, Any], text: str, outcome: EvaluationOutcome, folder: Path) -> None:
    document = {"outcome": str(outcome), **numbers}
    (folder / TEST).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    output.print(f"test data, not used before: free run {outcome}{text}", markup=False)


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
