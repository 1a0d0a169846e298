"""Reading of the records of jobs from uploaded data sets."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset, join
from islands.io.records import read_dataset
from islands.io.records.reading_options import ReadingOptions
from islands.io.records.row_range import parse_rows
from islands_service.domain.job_spec import Discrepancy, Identification, Part
from islands_service.store.blobs import Blobs, translate_disk_full
from islands_service.store.datasets import StoredDataset


@contextmanager
def link_blob(blob: Path, name: str) -> Iterator[Path]:
    """Provide a blob under its file name, which appears in messages and whose suffix selects the reader.

    Raises
    ------
    StorageFullError
    """
    with translate_disk_full(), tempfile.TemporaryDirectory(prefix="islands-record-") as folder:
        link = Path(folder) / name
        link.symlink_to(blob.absolute())
        yield link


def read_record_and_validation(
    spec: Identification, datasets: dict[str, StoredDataset], blobs: Blobs
) -> tuple[Dataset, Dataset | float]:
    """Read the recordings of a job that estimate, and its validation record or fraction.

    Raises
    ------
    RecordError
        A record cannot be used as specified.
    BlobNotFoundError
        The data folder has lost a file.
    """
    record = join(tuple(_read_part(spec, part, datasets, blobs) for part in spec.estimation))
    if isinstance(spec.validation, Part):
        return record, _read_part(spec, spec.validation, datasets, blobs)
    return record, spec.validation


def _read_part(
    spec: Identification | Discrepancy, part: Part, datasets: dict[str, StoredDataset], blobs: Blobs
) -> Dataset:
    stored = datasets[part.dataset]
    with link_blob(blobs.path(stored.blob), stored.name) as path:
        rows, options = parse_rows(part.rows), _reading_options(stored)
        return read_dataset(path, spec.inputs, spec.output, spec.dt, rows, options=options)


def _reading_options(stored: StoredDataset) -> ReadingOptions:
    return ReadingOptions(**stored.preview.get("reading", {}))


def read_record_and_columns(
    spec: Discrepancy, datasets: dict[str, StoredDataset], blobs: Blobs
) -> tuple[Dataset, dict[str, NDArray[np.float64]]]:
    """Read the recordings of a discrepancy job, and the column of a recorded simulation, if there is one.

    Raises
    ------
    RecordError
        The record cannot be used as specified.
    BlobNotFoundError
        The data folder has lost a file.
    """
    whole = join(tuple(_read_part(spec, part, datasets, blobs) for part in spec.parts))
    kept = 1 + len(spec.channels)
    return whole.first_inputs(kept), dict(zip(spec.recorded_columns, whole.u[:, kept:].T, strict=True))
