"""Reading of records and columns from an untrusted file, in a confined subprocess.

The subprocess sends names and numbers; this process parses nothing of the file. How a text is read depends on
the columns and rows of the job, so that a record is read for every job, not once for every upload.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError, suggest
from islands.records.dataset import Dataset
from islands_service.intake.confined_answer import open_answer
from islands_service.intake.confined_process import enter, refuse

#: Largest number of bytes of the description of a record.
_MAX_HEADER = 16_000_000

#: Numbers as they are sent.
_FLOAT = np.dtype("<f8")

#: Fields of `Dataset` that are sent as JSON.
_DESCRIBED = (
    *("dt", "input_names", "output_name", "input_units", "output_unit", "segments", "recordings"),
    *("start", "sha256", "reading"),
)


@dataclass(frozen=True, slots=True)
class RecordRequest:
    """Columns, rows and options of reading, as in `islands.records.reading.reader.read_dataset`."""

    inputs: Sequence[str]
    output: str | None
    dt: float | None
    rows: str | None
    reading: dict[str, object]
    resting_inputs: bool = False
    signals: Sequence[str] = ()
    missing_output: bool = False


def read_confined(path: Path, request: RecordRequest, memory: int, seconds: float) -> Dataset:
    """Read a record in a confined subprocess.

    Parameters
    ----------
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Raises
    ------
    RecordError
        The record cannot be used as it is, or not be read within the limits.
    MemoryError
        The subprocess was killed, as the kernel does if the machine has too little memory.
    """
    with open_answer("record_reading", path, asdict(request), memory, seconds) as answer:
        return receive_record(answer)


def send_record(record: Dataset, stream: IO[bytes]) -> None:
    """Write a record as a line of JSON and its numbers."""
    described = {name: getattr(record, name) for name in _DESCRIBED}
    stream.write(json.dumps({"shape": record.u.shape, **described}).encode() + b"\n")
    for values in (record.u, record.y):
        stream.write(values.astype(_FLOAT).tobytes())


def receive_record(stream: IO[bytes]) -> Dataset:
    """Read a record that `send_record` has written.

    Raises
    ------
    RecordError
        The bytes are not those of a record.
    """
    try:
        described = json.loads(stream.readline(_MAX_HEADER))
        samples, inputs = described["shape"]
        values = np.frombuffer(stream.read(), _FLOAT)
        u, y = values[: samples * inputs].reshape(samples, inputs), values[samples * inputs :]
        fields: dict[str, Any] = {name: _to_tuple(described[name]) for name in _DESCRIBED}
        return Dataset(u, y, **fields)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise RecordError(f"the process that reads records has answered nonsense: {error}") from error


def _to_tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def write_record() -> None:
    """Read the file named on standard input, and write the record to standard output."""
    path, asked, answer = enter(writes=True)
    # Only the process that reads files imports its readers.
    from islands.records.reading import read_dataset  # noqa: PLC0415
    from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
    from islands.records.reading.row_range import parse_rows  # noqa: PLC0415

    request = RecordRequest(**asked)
    try:
        options, rows = ReadingOptions(**request.reading), parse_rows(request.rows)  # type: ignore[arg-type]
        record = read_dataset(
            path,
            request.inputs,
            request.output,
            request.dt,
            rows,
            missing_output=request.missing_output,
            options=options,
            resting_inputs=request.resting_inputs,
            signals=request.signals,
        )
    except (RecordError, SettingsError) as error:
        refuse(error, answer)
    send_record(record, answer)
    answer.flush()


def read_columns(
    path: Path, names: Sequence[str], reading: Mapping[str, Any], memory: int, seconds: float
) -> NDArray[np.float64]:
    """Read columns of a file in a confined subprocess.

    Parameters
    ----------
    names : sequence of str
    reading : mapping
        Options of `islands.records.reading.options.ReadingOptions` that differ from the default.
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Returns
    -------
    columns : ndarray, shape (columns, samples)
        Missing values are NaN.

    Raises
    ------
    RecordError
        There is no such column, or it contains text.
    MemoryError
        The subprocess was killed, as the kernel does if the machine has too little memory.
    """
    asked = {"names": list(names), "reading": dict(reading)}
    with open_answer("column_reading", path, asked, memory, seconds) as answer:
        received = answer.read()
    if len(received) % (len(names) * _FLOAT.itemsize):
        raise RecordError("the process that reads columns has answered nonsense")
    return np.frombuffer(received, _FLOAT).reshape(len(names), -1)


def find_columns(path: Path, names: Sequence[str], reading: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return columns of a file in this process; see `read_columns`.

    Raises
    ------
    RecordError, SettingsError
        A column does not exist, or it contains text.
    """
    # Only the process that reads files imports its readers.
    from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
    from islands.records.reading.reader import open_record  # noqa: PLC0415

    table = open_record(path, ReadingOptions(**reading))
    for name in names:
        if name not in table.names:
            known = f"it has {', '.join(table.names)}{suggest(name, table.names)}"
            raise RecordError(f"{path.name} has no column {name}; {known}")
    numbers = table.read(names, None).numbers
    return np.array([numbers[name] for name in names], _FLOAT)


def write_columns() -> None:
    """Read the file named on standard input, and write its columns to standard output."""
    path, asked, answer = enter(writes=True)
    try:
        columns = find_columns(Path(path), asked["names"], asked["reading"])
    except (RecordError, SettingsError) as error:
        refuse(error, answer)
    answer.write(columns.tobytes())
    answer.flush()
