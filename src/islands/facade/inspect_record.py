"""`inspect_record`: columns, sampling and facts of a file or of a record, before a model is sought."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from islands.errors import SettingsError, check_seconds, name_without_value
from islands.facade.inspect_table import describe_values, inspect_table
from islands.records.dataset import Dataset
from islands.records.inspection.channel import channels
from islands.records.inspection.column_roles import ColumnChoice
from islands.records.inspection.findings import InspectedSampling, RecordInspection
from islands.records.inspection.record_facts import RecordFacts, measure_facts
from islands.records.inspection.stamp_regularity import NO_BREAKS
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.preview import preview_table
from islands.records.reading.reader import open_record
from islands.validation.linearity import check_linearity


def inspect_record(
    record: Dataset | str | Path,
    inputs: Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    rows: slice | None = None,
    reading: ReadingOptions = DEFAULT_READING,
) -> RecordInspection:
    """Describe a record before a model is sought.

    Parameters
    ----------
    record : Dataset, str or Path
        A record, or a file as for `read_record`. Gaps, repeated time stamps and missing values of a file are
        reported; the facts are then those of the parts between them.
    inputs, output : sequence of str, str or None
        Columns of the file. Without them, they are chosen by the names of the columns and by which column
        responds to which; ``choice`` states how sure that is. None is chosen without a visible response.
    dt : float, optional
        Sampling time in seconds, for files without a time column.
    rows : slice, optional
        Samples to inspect.
    reading : ReadingOptions
        Options of reading the file. With ``gaps`` or ``resample``, the facts are those of the repaired
        record.

    Returns
    -------
    RecordInspection
        ``facts`` holds the facts; ``find("dead-time")`` returns one of them.

    Raises
    ------
    RecordError
        The file cannot be read, or a column does not exist. The messages are those of `read_record`.
    SettingsError
        The record is neither a file nor a Dataset, or the sampling time is not a positive number.
    """
    if isinstance(record, Dataset):
        return _add_linearity(_inspect_dataset(record if rows is None else record[rows]))
    if not isinstance(record, str | Path):
        raise SettingsError(
            f"inspect_record takes a file or a Dataset, got a {type(record).__name__}: make a Dataset by "
            "as_record(data, inputs=..., output=...)"
        )
    if dt is not None:
        check_seconds(dt, name_without_value("dt"))
    # The file is parsed once: parsing takes most of the time.
    table = open_record(record, reading)
    found = preview_table(table, Path(record).name, reading)
    return _add_linearity(inspect_table(table, record, found, inputs, output, dt, rows, reading))


def _add_linearity(found: RecordInspection) -> RecordInspection:
    """Return an inspection with the fact whether a linear model explains the record.

    The free run of an unstable process diverges, so that it explains nothing.
    """
    if found.record is None or any(each.finding == "feedback_unstable" for each in found.facts.facts):
        return found
    at_once = any(each.name == "dead-time" and each.value == 0.0 for each in found.facts.facts)
    fact = check_linearity(found.record, feedthrough=at_once)
    return replace(found, facts=RecordFacts((*found.facts.facts, fact)))


def _inspect_dataset(record: Dataset) -> RecordInspection:
    columns = tuple(
        describe_values(
            channel.name, channel.unit, "output" if channel.is_output else "input", channel.values
        )
        for channel in channels(record)
    )
    sampling = InspectedSampling(None, record.samples, record.dt, None, (), (), (), NO_BREAKS, "")
    choice = ColumnChoice(record.input_names, record.output_name, None, "choice_given")
    return RecordInspection("", columns, sampling, choice, measure_facts(record), (), "", record=record)
