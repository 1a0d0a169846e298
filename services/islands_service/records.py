"""Records of jobs: from uploaded data sets to what the core identifies."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from islands.data.dataset import Dataset
from islands.io.records import read_record
from islands_service.blobs import Blobs, full_disk_told
from islands_service.rows import rows_of
from islands_service.specification import Identification, Part
from islands_service.store.datasets import StoredDataset


@contextmanager
def named(blob: Path, name: str) -> Iterator[Path]:
    """Give a blob its owner's name for it: messages speak of that, and its suffix chooses the reader.

    Raises
    ------
    StoreFull
    """
    with full_disk_told(), tempfile.TemporaryDirectory(prefix="islands-record-") as folder:
        link = Path(folder) / name
        link.symlink_to(blob.absolute())
        yield link


def record_and_validation(
    spec: Identification, datasets: dict[str, StoredDataset], blobs: Blobs
) -> tuple[Dataset, Dataset | float]:
    """Read what a job estimates from, and what it validates with.

    Raises
    ------
    RecordError
        A record cannot be used as the job says.
    NoSuchBlob
        The data folder has lost a file.
    """

    def read(dataset: str, rows: str | None) -> Dataset:
        stored = datasets[dataset]
        with named(blobs.path(stored.blob), stored.name) as path:
            return read_record(path, spec.inputs, spec.output, spec.dt, rows_of(rows))

    record = read(spec.dataset, spec.rows)
    if isinstance(spec.validation, Part):
        return record, read(spec.validation.dataset, spec.validation.rows)
    return record, spec.validation
