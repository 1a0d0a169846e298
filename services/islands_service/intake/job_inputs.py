"""Reading of the records of jobs from uploaded data sets."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset, join
from islands.records.reading.row_range import parse_rows
from islands.records.split import hold_out
from islands_service.domain.job_spec import Discrepancy, Identification, Part
from islands_service.intake.record_reading import RecordRequest, read_confined
from islands_service.settings import service_settings
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


def read_beginning(
    spec: Identification, datasets: dict[str, StoredDataset], blobs: Blobs, most: int
) -> Dataset:
    """Read the first recording of a job, at most its first ``most`` samples, with the inputs as measured.

    Raises
    ------
    RecordError
        The record cannot be used as specified.
    BlobNotFoundError
        The data folder has lost a file.
    """
    part = spec.estimation[0]
    samples = datasets[part.dataset].preview.get("samples")
    # Columns of different lengths have no number of samples; such a recording is read as it is specified.
    if samples is not None:
        first, stop, _ = (parse_rows(part.rows) or slice(None)).indices(samples)
        part = Part(dataset=part.dataset, rows=f"{first}:{min(stop, first + most)}")
    measured = tuple(parse_channel_name(name).base for name in spec.inputs)
    return _read_part(spec.model_copy(update={"inputs": measured}), part, datasets, blobs)


def _read_part(
    spec: Identification | Discrepancy, part: Part, datasets: dict[str, StoredDataset], blobs: Blobs
) -> Dataset:
    stored = datasets[part.dataset]
    reading = stored.preview.get("reading", {})
    is_diagnosis = isinstance(spec, Discrepancy)
    signals = spec.recorded_columns if isinstance(spec, Discrepancy) else ()
    request = RecordRequest(*spec.columns, spec.dt, part.rows, reading, is_diagnosis, signals)
    settings = service_settings()
    memory, seconds = settings.inspection_memory, settings.inspection_seconds
    with blobs.hold(stored.blob) as held, link_blob(held, stored.name) as path:
        return read_confined(path, request, memory, seconds)


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
    whole = join(tuple(_read_part(spec, part, datasets, blobs) for part in spec.estimation))
    if spec.validation is not None:
        whole = hold_out(whole, _read_part(spec, spec.validation, datasets, blobs))
    kept = 1 + len(spec.channels)
    return whole.first_inputs(kept), dict(zip(spec.recorded_columns, whole.u[:, kept:].T, strict=True))
