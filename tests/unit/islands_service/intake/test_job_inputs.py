"""Records of a job: every recording is read with the columns of the job and keeps its name."""

from pathlib import Path

import numpy as np
import pytest

from islands_service.domain.job_spec import Discrepancy, Identification, Part
from islands_service.intake.job_inputs import (
    read_beginning,
    read_record_and_columns,
    read_record_and_validation,
)
from islands_service.store.blobs import Blobs
from islands_service.store.datasets import StoredDataset
from support.service import csv, spec


def store_datasets(blobs: Blobs) -> dict[str, StoredDataset]:
    return {
        name: StoredDataset("me", name, f"{name}.csv", ".csv", blobs.write(csv(samples)), 7, {}, 0.0)
        for name, samples in (("a", 120), ("b", 90))
    }


def test_recordings_of_a_diagnosis_are_joined_with_their_recorded_simulations(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path)
    order = Discrepancy.model_validate(
        {
            "dataset": "a",
            "input": "u_V",
            "output": "y_um",
            "dt": 0.01,
            "recordings": [{"dataset": "b", "rows": "5:"}],
            "simulation": {"kind": "column", "column": "t_s"},
        }
    )
    record, columns = read_record_and_columns(order, store_datasets(blobs), blobs)
    assert record.rows_by_recording == {"a.csv": slice(0, 120), "b.csv": slice(120, 205)}
    assert record.input_names == ("u_V",)
    assert np.flatnonzero(np.diff(columns["t_s"]) < 0.0).tolist() == [119]
    changes = {"rows": "0:70", "recordings": (), "validation": Part(dataset="a", rows="70:")}
    divided, _ = read_record_and_columns(order.model_copy(update=changes), store_datasets(blobs), blobs)
    assert (divided.held_out, record.held_out) == (50, 0)
    assert np.array_equal(divided.u, record.u[:120])


def test_a_recorded_simulation_is_read_at_the_samples_of_a_slow_output(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path)
    rng = np.random.default_rng(3)
    u, y, simulated = rng.normal(size=(3, 600))
    rows = [f"{0.01 * k:.2f},{u[k]},{simulated[k]},{y[k] if k % 10 == 0 else ''}" for k in range(600)]
    stored = blobs.write("\n".join(["t_s,u,s,y", *rows]).encode())
    datasets = {"a": StoredDataset("me", "a", "a.csv", ".csv", stored, 7, {}, 0.0)}
    order = Discrepancy.model_validate(
        {"dataset": "a", "input": "u", "output": "y", "simulation": {"kind": "column", "column": "s"}}
    )
    _, columns = read_record_and_columns(order, datasets, blobs)
    assert np.array_equal(columns["s"], simulated[::10])


@pytest.mark.ci
@pytest.mark.parametrize(
    ("rows", "most", "expected"),
    [
        (None, 50, slice(0, 50)),
        (None, 500, slice(0, 120)),
        ("-60:-20", 500, slice(60, 100)),
        ("60:", 40, slice(60, 100)),
    ],
)
def test_the_beginning_of_a_job_has_inputs_as_measured(
    tmp_path: Path, rows: str | None, most: int, expected: slice
) -> None:
    blobs = Blobs(tmp_path)
    stored = StoredDataset("me", "a", "a.csv", ".csv", blobs.write(csv(120)), 7, {"samples": 120}, 0.0)
    order = Identification.model_validate(
        {**spec("a"), "inputs": ["u_V"], **({"rows": rows} if rows else {})}
    )
    whole, _ = read_record_and_validation(order.model_copy(update={"rows": None}), {"a": stored}, blobs)
    early = order.model_copy(update={"inputs": ("u_V+1",)})
    for each in (order, early):
        found = read_beginning(each, {"a": stored}, blobs, most)
        assert found.input_names == ("u_V",)
        assert np.array_equal(found.u, whole.u[expected])
        assert np.array_equal(found.y, whole.y[expected])
