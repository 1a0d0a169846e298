"""Inputs of jobs: the records of uploaded data sets, and the FMU, which the service may refuse to run."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError
from islands.records.channel_names import parse_channel_name
from islands.records.coupled import AnyRecord, couple, unite
from islands.records.dataset import Dataset, join
from islands.records.reading.column_names import find_column
from islands.records.reading.row_range import parse_rows
from islands.records.split import hold_out
from islands_service.domain.job_spec import Discrepancy, Identification, Part
from islands_service.domain.uploaded_fmu import UploadedFmuSpec, check_interface, read_fmu
from islands_service.intake.confined_process import explain_gaps, explain_no_fmus
from islands_service.intake.confinement import find_gaps
from islands_service.intake.record_reading import RecordRequest, read_confined
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store.blobs import Blobs, translate_disk_full
from islands_service.store.datasets import StoredDataset

if TYPE_CHECKING:
    from islands.simulators.fmu.instance import FmuSource


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
) -> tuple[AnyRecord, AnyRecord | float]:
    """Read the recordings of a job that estimate, and its validation record or fraction.

    Raises
    ------
    RecordError
        A record cannot be used as specified.
    BlobNotFoundError
        The data folder has lost a file.
    """
    record = join(tuple(_read_part(spec, part, datasets, blobs) for part in spec.estimation))
    coupled, validation = couple(record, len(spec.outputs)), spec.validation
    if isinstance(validation, Part):
        return coupled, couple(_read_part(spec, validation, datasets, blobs), len(spec.outputs))
    return coupled, validation


def read_beginning(
    spec: Identification, datasets: dict[str, StoredDataset], blobs: Blobs, most: int
) -> AnyRecord:
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
    found = _read_part(spec.model_copy(update={"inputs": measured}), part, datasets, blobs)
    return couple(found, len(spec.outputs))


def _read_part(
    spec: Identification | Discrepancy, part: Part, datasets: dict[str, StoredDataset], blobs: Blobs
) -> Dataset:
    stored = datasets[part.dataset]
    reading = stored.preview.get("reading", {})
    is_diagnosis = isinstance(spec, Discrepancy)
    signals = spec.recorded_columns if isinstance(spec, Discrepancy) else ()
    request = RecordRequest(*spec.columns, spec.dt, part.rows, reading, is_diagnosis, signals)
    return _read_stored(stored, request, blobs)


def _read_stored(stored: StoredDataset, request: RecordRequest, blobs: Blobs) -> Dataset:
    settings = service_settings()
    memory, seconds = settings.inspection_memory, settings.inspection_seconds
    with blobs.hold(stored.blob) as held, link_blob(held, stored.name) as path:
        return read_confined(path, request, memory, seconds)


def read_scenario(
    stored: StoredDataset,
    columns: tuple[Sequence[str], Sequence[str]],
    rows: str | None,
    dt: float | None,
    blobs: Blobs,
) -> AnyRecord:
    """Read a data set that a model simulates, which may lack the outputs.

    Parameters
    ----------
    stored : StoredDataset
    columns : pair of sequence of str
        Inputs and outputs of the model.
    rows : str or None
        ``START:STOP``, the rows that are read.
    dt : float or None
        Sampling time in seconds, if the data set does not state it.
    blobs : Blobs

    Raises
    ------
    RecordError
        The record cannot be used as specified.
    BlobNotFoundError
        The data folder has lost a file.
    """
    inputs, outputs = columns
    known = [str(each["name"]) for each in stored.preview.get("columns", ())]
    reading = stored.preview.get("reading", {})

    def read_output(name: str) -> Dataset:
        is_known = find_column(name, known) in known
        request = RecordRequest(inputs, name if is_known else None, dt, rows, reading, missing_output=True)
        found = _read_stored(stored, request, blobs)
        return found if is_known else replace(found, output_name=name)

    return unite([read_output(name) for name in outputs])


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


def explain_refusal(settings: ServiceSettings) -> str:
    """Return why a service runs no FMUs, and what to do; empty if it runs them."""
    if not settings.allow_fmus:
        return explain_no_fmus("ask its operator to set ISLANDS_ALLOW_FMUS=true")
    if find_spec("fmpy") is None:
        return describe_missing_extra("the simulation of an FMU", "fmi")
    gaps = find_gaps()
    return explain_gaps(gaps) if gaps else ""


def check_allowed(settings: ServiceSettings) -> None:
    """Refuse FMUs unless the operator allows them, and this machine can confine them.

    Raises
    ------
    SettingsError
    """
    if refusal := explain_refusal(settings):
        raise SettingsError(refusal)


def check_fmu(spec: UploadedFmuSpec, stored: StoredDataset) -> None:
    """Check the variables and the equations of a simulation against the description of its FMU.

    Raises
    ------
    SettingsError
        A variable is missing or unknown, or a value is out of range.
    ModelError
        The equations are invalid.
    """
    description = read_fmu(stored.preview["fmu"], stored.name)
    spec.make_system(spec.make_model(lambda _, interface: check_interface(description, interface)))


@contextmanager
def open_fmu(
    stored: StoredDataset, blobs: Blobs, seconds: float, check: Callable[[], None]
) -> Iterator["FmuSource"]:
    """Provide the FMU of a job in a confined process while the block runs.

    Parameters
    ----------
    seconds : float
        Longest time of the CPU.
    check : callable
        Called during simulations; raises the reason if they must end.

    Raises
    ------
    SettingsError
        The service does not run FMUs.
    ModelError
        The FMU cannot be loaded.
    BlobNotFoundError
        The data folder has lost the file.
    """
    # Only jobs with an FMU import the kernels here.
    from islands_service.intake.confined_fmu import open_confined  # noqa: PLC0415

    settings = service_settings()
    check_allowed(settings)
    description = read_fmu(stored.preview["fmu"], stored.name)
    with (
        blobs.hold(stored.blob) as held,
        link_blob(held, stored.name) as path,
        open_confined(path, description, settings.inspection_memory, seconds, check) as source,
    ):
        yield source
