"""Reading of the columns of an untrusted file for a plot, in a confined subprocess."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from islands.errors import RecordError, SettingsError, suggest
from islands_service.domain.plot_envelopes import describe_envelopes
from islands_service.intake.confined_answer import ask_confined
from islands_service.intake.confined_process import enter, refuse, send_document


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """Columns and rows of a plot.

    Attributes
    ----------
    columns : tuple of str
    start, stop : int, int or None
        First row, from 0, and the row after the last one; None is the end of the file.
    points : int
        Largest number of values of each column.
    reading : mapping
        Options of `islands.io.records.reading_options.ReadingOptions` that differ from the default.
    """

    columns: tuple[str, ...]
    start: int
    stop: int | None
    points: int
    reading: Mapping[str, Any] = field(default_factory=dict)


async def read_samples(path: Path, request: SampleRequest, memory: int, seconds: float) -> Mapping[str, Any]:
    """Return the envelopes of columns as a document with the fields of `islands_api.dataset_schemas.Samples`.

    Parameters
    ----------
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Raises
    ------
    RecordError
        There is no such column, it contains text, or the file has fewer rows than ``start``.
    """
    return await ask_confined("sample_reading", path, asdict(request), memory, seconds)


def main() -> None:
    """Read the file named on standard input, and write the envelopes to standard output."""
    path, asked, answer = enter()
    try:
        document = describe_samples(Path(path), SampleRequest(**asked))
    except (RecordError, SettingsError) as error:
        refuse(error, answer)
    send_document(document, answer)


def describe_samples(path: Path, request: SampleRequest) -> dict[str, Any]:
    """Return the envelopes of columns in this process; see `read_samples`.

    Raises
    ------
    RecordError, SettingsError
        The columns or the rows do not exist, or a column contains text.
    """
    # Only the process that reads files imports its readers.
    from islands.io.records.reader import open_record  # noqa: PLC0415
    from islands.io.records.reading_options import ReadingOptions  # noqa: PLC0415

    table = open_record(path, ReadingOptions(**request.reading))
    for name in request.columns:
        if name not in table.names:
            known = f"it has {', '.join(table.names)}{suggest(name, table.names)}"
            raise RecordError(f"{path.name} has no column {name}; {known}")
    read = table.read(request.columns, slice(request.start, request.stop))
    signals = {name: read.numbers[name] for name in request.columns}
    rows, columns = describe_envelopes(signals, read.first, request.points)
    return {"start": read.first, "stop": read.first + len(read.rows), "rows": rows, "columns": columns}
