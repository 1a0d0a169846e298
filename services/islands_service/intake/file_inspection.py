"""Inspection of an untrusted file in a confined subprocess with limited memory and time.

A file that exhausts memory, or makes its reader loop, ends only this subprocess.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from islands.errors import RecordError, SettingsError, suggest
from islands_service.intake.confined_answer import ask_confined
from islands_service.intake.confined_process import enter, refuse, send_document
from islands_service.settings import ServiceSettings

if TYPE_CHECKING:
    from islands.records.inspection.record_note import RecordNote
    from islands.records.reading import Preview
    from islands.records.reading.options import ReadingOptions
    from islands.records.reading.table import Table


#: Largest ratio of unpacked to received bytes. Text of measured values has 3 to 30, constant columns more.
EXPANSION = 100

#: Bytes that every file may unpack to: the unit of the slots of inspections.
SLOT_BYTES = 64_000_000

#: Least address space of a reader in bytes: its libraries, and 18 for each byte of a text of `SLOT_BYTES`.
_LEAST_MEMORY = 1_500_000_000

#: Largest number of columns of a record: their descriptions are stored, and shown in every list.
_MAX_COLUMNS = 1000

#: Longest name of a column: a job cannot contain a longer one (`islands_service.domain.job_spec.Name`).
_MAX_NAME = 200

#: Characters of a longer name in a message.
_SHOWN = 40


@dataclass(frozen=True, slots=True)
class InspectionLimits:
    """Limits of the inspection of one file.

    Attributes
    ----------
    unpacked : int
        Bytes that the file may unpack to.
    memory : int
        Bytes of address space of the process that reads it, which bounds what a reader unpacks.
    slots : int
        Part of what all inspections may take at once, in units of `SLOT_BYTES`.
    """

    unpacked: int
    memory: int
    slots: int


def find_limits(received: int, settings: ServiceSettings) -> InspectionLimits:
    """Return the limits of a file by the number of its bytes as they were received."""
    most = settings.max_unpacked
    unpacked = min(max(SLOT_BYTES, EXPANSION * received), most)
    memory = min(_LEAST_MEMORY + settings.inspection_memory * unpacked // most, settings.inspection_memory)
    return InspectionLimits(unpacked, memory, count_slots(unpacked))


def count_slots(size: int) -> int:
    """Return the number of slots of a file that unpacks to some bytes."""
    return -(-size // SLOT_BYTES)


@dataclass(frozen=True, slots=True)
class InspectionRequest:
    """Parameters of an inspection.

    Attributes
    ----------
    inputs, output : tuple of str, str or None
        Columns to read in the same way as a job; without an output the file is only described.
    dt, rows : float, str or None
        As in a job of `islands_service.domain.job_spec`.
    reading : mapping
        Options of `islands.records.reading.options.ReadingOptions` that differ from the default.
    resting_inputs : bool
        Accept constant inputs.
    """

    inputs: tuple[str, ...] = ()
    output: str | None = None
    dt: float | None = None
    rows: str | None = None
    reading: Mapping[str, Any] = field(default_factory=dict)
    resting_inputs: bool = False


async def inspect_file(
    path: Path, request: InspectionRequest, memory: int, seconds: float
) -> Mapping[str, Any]:
    """Describe a file, and read the requested columns.

    Parameters
    ----------
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Returns
    -------
    mapping
        An `islands.records.reading.preview.Preview` as a document, with the keys ``notes`` in place of
        ``problems``, ``inspection`` and ``reading``.

    Raises
    ------
    RecordError
        The file or the requested columns cannot be read.
    """
    return await ask_confined("file_inspection", path, asdict(request), memory, seconds)


def main() -> None:
    """Inspect the file named on standard input, and write the result to standard output."""
    path, asked, answer = enter()
    try:
        document = describe_file(Path(path), InspectionRequest(**asked))
    except (RecordError, SettingsError) as error:
        refuse(error, answer)
    send_document(document, answer)


def describe_file(path: Path, request: InspectionRequest) -> dict[str, Any]:
    """Describe a file, and read the requested columns, in this process; see `inspect_file`.

    Raises
    ------
    RecordError, SettingsError
        The file, the requested columns or the options of reading cannot be used.
    """
    # Only the process that reads files imports its readers.
    from islands.records.reading.open_table import read_table  # noqa: PLC0415
    from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
    from islands.records.reading.preview import preview_table  # noqa: PLC0415
    from islands.records.reading.reader import open_record  # noqa: PLC0415
    from islands.records.reading.row_range import parse_rows  # noqa: PLC0415
    from islands.records.reading.sampling.common_clock import merge_notes  # noqa: PLC0415

    options = ReadingOptions(**request.reading)
    # The file is parsed once, because parsing takes most of the time: all that follows reads this table.
    table, name = open_record(path, options), path.name
    _check_columns([column for column in table.names if column], name)
    preview = preview_table(table, name, options)
    # Check this first: a message about missing columns lists the existing ones.
    _check_readable(preview, name)
    assumed: tuple[str, ...] = ()
    if request.inputs and request.output is not None:
        record = read_table(
            table,
            name,
            request.inputs,
            request.output,
            request.dt,
            parse_rows(request.rows),
            options=options,
            resting_inputs=request.resting_inputs,
        )
        assumed = record.reading
    elif options.gaps is None:
        _check_usable(table, {column.name: column.problem for column in preview.columns}, request)
    measured, inspected, noted = _measure(table, preview, path, request, options)
    if measured is not None:
        stated = [note.text for note in noted]
        solved = [text for text in preview.problems if text not in stated]
        preview = replace(preview, warnings=tuple(text for text in preview.warnings if text not in solved))
    notes = _merge_notes(merge_notes(preview.warnings, assumed or inspected), preview.problems, noted)
    if options.resample is not None:
        preview = replace(preview, dt=options.resample)
    described = asdict(replace(preview, warnings=tuple(note.text for note in notes)))
    del described["problems"]
    return {
        **described,
        "notes": [note.as_document() for note in notes],
        "inspection": measured,
        "reading": options.changes(),
    }


def _merge_notes(
    warnings: tuple[str, ...], problems: Sequence[str], noted: Sequence["RecordNote"]
) -> list["RecordNote"]:
    """Return notes for all warnings, and the notes of an inspection that state something else.

    The inspection ends some notes with the option that changes them.
    """
    from islands.records.inspection.record_note import make_note  # noqa: PLC0415

    found = []
    for text in warnings:
        same = next((note for note in noted if note.text.startswith(text)), None)
        found.append(same or make_note(text, text in problems))
    return [*found, *(note for note in noted if note not in found)]


def _measure(
    table: "Table", found: "Preview", path: Path, request: InspectionRequest, options: "ReadingOptions"
) -> tuple[dict[str, Any] | None, tuple[str, ...], tuple["RecordNote", ...]]:
    """Return the choice of columns with the facts about the record, how it was read, and notes about it.

    There are no facts without a choice or a sampling; the reason of the choice then says why. All are empty
    if the file has no record.
    """
    from islands.facade.inspect_table import inspect_table  # noqa: PLC0415
    from islands.records.inspection.record_facts import MOST_SAMPLES  # noqa: PLC0415
    from islands.records.reading.row_range import parse_rows  # noqa: PLC0415

    rows = request.rows
    if rows is None and found.samples > MOST_SAMPLES:
        first = (found.samples - MOST_SAMPLES) // 2
        rows = f"{first}:{first + MOST_SAMPLES}"
    try:
        inspected = inspect_table(
            table, path, found, request.inputs, request.output, request.dt, parse_rows(rows), options
        )
    except RecordError:
        # The preview states the problems of the file.
        return None, (), ()
    document = inspected.as_document()
    assumed = () if inspected.record is None else inspected.record.reading
    measured = {"rows": rows, **{name: document[name] for name in ("choice", "facts", "remedy", "sampling")}}
    return measured, assumed, inspected.notes


def _check_columns(names: Sequence[str], file: str) -> None:
    """Reject a file with too many columns to display, before any of them is read."""
    if len(names) > _MAX_COLUMNS:
        raise RecordError(
            f"{file} has {len(names)} columns, and {_MAX_COLUMNS} is the most: leave out what is not needed"
        )
    for name in names:
        if len(name) > _MAX_NAME:
            raise RecordError(
                f"{file} has a column {name[:_SHOWN]}... whose name has {len(name)} characters, and "
                f"{_MAX_NAME} is the most: give it a shorter one"
            )


def _check_readable(found: "Preview", file: str) -> None:
    """Reject a file that no job could read."""
    if not found.samples:
        problems = [column.problem for column in found.columns if column.problem]
        raise RecordError(problems[0] if problems else f"{file} has no columns: export it again")


def _check_usable(table: "Table", problems: Mapping[str, str], request: InspectionRequest) -> None:
    """Reject columns with a problem in the preview, if the job that would read them is not known yet."""
    from islands.records.reading.column_names import find_column  # noqa: PLC0415
    from islands.records.reading.validation import check_values  # noqa: PLC0415

    for name in (*request.inputs, *([] if request.output is None else [request.output])):
        source = find_column(name, problems)
        if source not in problems:
            raise RecordError(
                f"the record has no column {name}; it has {', '.join(problems)}{suggest(name, problems)}"
            )
        if problems[source]:
            raise RecordError(problems[source])
        if name in request.inputs:
            check_values(table.read((source,), None), source)
