"""Inputs and an output of an open table, with checks for all that would make an identification fail."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option
from islands.records.channel_names import AT_ONCE, parse_unit
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_inputs
from islands.records.inspection.channel import channels
from islands.records.inspection.gross_errors import find_gross_errors, find_input_codes
from islands.records.inspection.quantisation import find_quantisation
from islands.records.inspection.saturation import find_saturation
from islands.records.inspection.static_curve import describe_static_curve, is_static_curve
from islands.records.reading.column_names import (
    find_column,
    list_inputs,
    split_structures,
    take_outputs,
)
from islands.records.reading.options import DEFAULT_READING, KEEP, MEAN, ROWS, ReadingOptions
from islands.records.reading.sampling.column_clocks import ColumnClock, find_clocks, may_differ
from islands.records.reading.sampling.common_clock import (
    ColumnUse,
    align_columns,
    choose_rates,
    fill_between,
)
from islands.records.reading.sampling.recording import Recording, UniformRecording
from islands.records.reading.sampling.repair import join_recordings, make_uniform
from islands.records.reading.sampling.time_step import (
    TimeSource,
    find_sampling,
    find_time_column,
    find_time_scale,
    make_recording,
)
from islands.records.reading.sampling.uniform_grid import AGREEMENT
from islands.records.reading.table import Columns, Table
from islands.records.reading.validation import (
    and_others,
    check_choice,
    check_length,
    check_repaired,
    check_values,
    check_varies,
)

#: Known samples of an output of which it is stated that it may be saturated, at least.
_LEAST_SATURATED = 100


def read_table(
    table: Table,
    file: str,
    inputs: Sequence[str],
    output: str | None,
    dt: float | None = None,
    rows: slice | None = None,
    missing_output: bool = False,
    options: ReadingOptions = DEFAULT_READING,
    resting_inputs: bool = False,
    signals: Sequence[str] = (),
) -> Dataset:
    """Read inputs and an output from an open table and check them.

    Parameters
    ----------
    table : Table
    file : str
        Name of the table in messages.
    inputs, output, dt, rows, missing_output
        As in `islands.records.reading.reader.read_record`.
    options : ReadingOptions
        The time column, and the repair of irregular sampling.
    resting_inputs : bool
        Accept constant inputs.
    signals : sequence of str
        Inputs that are read at the samples of the record whatever their rate, such as the output of a
        simulation; others may be averaged from each sample to the next.

    Raises
    ------
    RecordError
        The record cannot be used as it is.
    """
    inputs, (output,) = list_inputs(inputs), take_outputs(output) or (None,)
    sources = [find_column(name, table.names) for name in inputs]
    output = None if output is None else find_column(output, table.names)
    outputs = () if output is None else (output,)
    chosen = (*sources, *outputs)
    time = None if options.time is None else find_column(options.time, table.names)
    check_choice(table.names, sources, output, file, time, table.others)
    structures = split_structures(table.names)
    structure = structures[chosen[-1]]
    clock = time or find_time_column(table, file, chosen, structure)
    columns = table.read(tuple(dict.fromkeys((*chosen, *([clock] if clock else [])))), rows)
    is_timed = clock is not None or dt is not None or bool(table.stated(structure))
    if output is not None and len(sources) == 1 and not (is_timed or missing_output):
        (source_name,) = sources
        if is_static_curve(columns.numbers[source_name], columns.numbers[output]):
            raise RecordError(describe_static_curve(file, source_name, output))
    # A simulation needs no more samples than the lags of its model, which it checks.
    check_length(columns, *([2] if missing_output else []))
    measured = None if output is None else columns.numbers[output]
    columns, excluded = exclude_gross_errors(columns, sources, output, options)
    source = TimeSource(table, clock, dt, structure, options)
    required = [name for name in columns.numbers if not (missing_output and name == output)]
    steps = [*columns.notes, *(f"{errors} are left out" for errors in excluded)]
    parts = [part for part in columns.split(clock) if len(part.rows) > 1]
    values = np.column_stack([columns.numbers[name] for name in chosen])
    use = ColumnUse(
        *(chosen, tuple(range(len(sources), len(chosen))), options.rates or MEAN, missing_output),
        signals=tuple(place for place, name in enumerate(inputs) if name in signals),
    )
    clocks = None
    if len(parts) == 1:
        clocks = _find_clocks(source, columns, values, use)
    if clocks is not None:
        found = _read_clocks(*clocks, use, required, options)
    else:
        if options.gaps is None:
            _check_columns(columns, output)
        steps += _describe_parts(parts)
        found = _read_rows(source, columns, parts, chosen, required)
    found = replace(found, steps=(*steps, *found.steps))
    for name in () if missing_output else (*(() if resting_inputs else sources), *outputs):
        check_varies(columns, name)
    if clock is not None:
        note = find_time_scale(source, columns).note
        found = replace(found, steps=(*([note] if note else []), *found.steps))
    record = _make_record(found, sources, output, structures, columns.units, file)
    if output is not None and (note := _describe_saturation(record)):
        record = replace(record, reading=(*record.reading, note))
    record = advance_inputs(record, _find_advanced(inputs, sources))
    if measured is None or len(measured) != record.samples:
        return record
    is_left_out = np.isnan(record.y) & np.isfinite(measured)
    return replace(record, measured=measured) if is_left_out.any() else record


def _read_rows(
    source: TimeSource,
    columns: Columns,
    parts: Sequence[Columns],
    chosen: Sequence[str],
    required: Sequence[str],
) -> UniformRecording:
    """Read columns whose samples are the rows of the file; each part is a segment."""
    options = source.options
    blocks = [np.column_stack([part.numbers[name] for name in chosen]) for part in parts]
    if options.gaps is None and options.resample is None:
        step, start = find_sampling(source, columns)
        start = step * columns.first if start is None else start
        segments = tuple(map(len, blocks)) if len(blocks) > 1 else ()
        return UniformRecording(np.concatenate(blocks), step, start, segments, ())
    recordings = [make_recording(source, part, values) for part, values in zip(parts, blocks, strict=True)]
    return _repair(recordings, chosen, required, options, columns.rows.file)


def _check_columns(columns: Columns, output: str | None) -> None:
    for name in columns.numbers:
        check_values(columns, name, missing=name == output)


def _find_clocks(
    source: TimeSource, columns: Columns, values: NDArray[np.float64], use: ColumnUse
) -> tuple[Recording, tuple[ColumnClock, ...]] | None:
    """Return the rows with their times and the clocks of the columns; None if these are that of the rows."""
    options, dt = source.options, source.dt
    if options.rates == ROWS or not may_differ(values, use.outputs):
        return None
    try:
        recording = make_recording(source, columns, values)
    except RecordError:
        return None  # The checks of the columns come first.
    problem = None
    try:
        step = find_sampling(source, columns)[0] / recording.seconds
        recording = replace(recording, stamps=recording.stamps[0] + step * np.arange(len(values)))
    except RecordError as error:
        problem = error
    clocks = find_clocks(recording.stamps, values, use.outputs)
    is_filled = options.gaps == "interpolate" and options.resample is None and problem is None
    if not clocks or (is_filled and all(each.kind != "held" for each in clocks)):
        return None
    longest = max(each.step for each in clocks) * recording.seconds
    if problem is not None and dt is not None and abs(longest - dt) > AGREEMENT * dt:
        raise problem
    return recording, clocks


def _read_clocks(
    recording: Recording,
    clocks: Sequence[ColumnClock],
    use: ColumnUse,
    required: Sequence[str],
    options: ReadingOptions,
) -> UniformRecording:
    """Bring columns of different clocks together and make the sampling uniform."""
    steps: list[str] = []
    if options.resample is None:
        if options.rates is None:
            use = replace(use, rates=choose_rates(recording, clocks, use))
        recording = align_columns(recording, clocks, use, steps)
    else:
        recording = fill_between(recording, clocks, use, steps)
    if options.gaps is None:
        numbers = dict(zip(use.names, recording.values.T, strict=True))
        known = Columns(recording.rows, numbers, 0)
        for place, name in enumerate(use.names):
            check_values(known, name, missing=place in use.outputs)
        required = [name for place, name in enumerate(use.names) if place not in use.outputs]
    found = _repair([recording], use.names, required, options, recording.rows.file)
    # 59.9 s / 599 is not 0.1 s in binary numbers.
    return replace(found, dt=float(f"{found.dt:.12g}"), steps=(*steps, *found.steps))


def _describe_parts(parts: Sequence[Columns]) -> list[str]:
    if len(parts) < 2:
        return []
    return [
        f"split at repeated headers into {len(parts)} segments, the second begins in {parts[1].rows.row(0)}"
    ]


def exclude_gross_errors(
    columns: Columns, inputs: Sequence[str], output: str | None, options: ReadingOptions
) -> tuple[Columns, tuple[str, ...]]:
    """Return the columns with missing values in place of gross errors, and what the errors are.

    Raises
    ------
    RecordError
        An input has codes of missing values, and the options do not say what becomes of the gaps.
    """
    if options.outliers == KEEP or output is None:
        return columns, ()
    numbers, excluded = dict(columns.numbers), []
    for name in dict.fromkeys(inputs):
        for code, samples in find_input_codes(numbers[name]).items():
            if options.gaps is None:
                raise RecordError(
                    join_text(
                        f"{columns.rows.place(int(samples[0]), name)}{and_others(samples.size)} "
                        f"{code:.12g}, a code of missing values: give ",
                        name_option("gaps", "split"),
                        " to leave the rows out or ",
                        name_option("gaps", "interpolate"),
                        " to fill them, or ",
                        name_option("outliers", "keep"),
                        " if it is a value",
                    )
                )
            numbers[name] = np.where(numbers[name] == code, np.nan, numbers[name])
            excluded.append(
                f"gross errors of {name}: {samples.size} times {code:.12g}, a code of missing values"
            )
    errors = find_gross_errors(numbers[output], np.column_stack([numbers[name] for name in inputs]))
    if errors.samples.size:
        y = numbers[output].copy()
        y[errors.samples] = np.nan
        numbers[output] = y
        excluded.append(f"gross errors of {output}: {errors.describe(columns.rows.row)}")
    return replace(columns, numbers=numbers), tuple(excluded)


def _describe_saturation(record: Dataset) -> str:
    """Return that the output is flat at an extreme; empty if it is not, or if its samples are few.

    A limited output and the output of a system at its limit look the same, so that the samples are used.
    """
    channel = channels(record)[-1]
    # The range of numbers of the largest magnitude is infinite; a search refuses them.
    with np.errstate(over="ignore"):
        if channel.known.size < _LEAST_SATURATED or not 0.0 < np.ptp(channel.known) < np.inf:
            return ""
    fact = find_saturation(channel, find_quantisation(channel))
    if not fact.value:
        return ""
    return f"{fact.sentence.removesuffix('.')}; these samples are used"


def _repair(
    recordings: Sequence[Recording],
    chosen: Sequence[str],
    required: Sequence[str],
    options: ReadingOptions,
    file: str,
) -> UniformRecording:
    """Make the sampling uniform, and check the columns; those that are not required may lack values."""
    places = [place for place, name in enumerate(chosen) if name in required]
    found = join_recordings(
        [make_uniform(recording, places, options.gaps, options.resample) for recording in recordings], file
    )
    for name, column in zip(chosen, found.values.T, strict=True):
        check_repaired(column, name, file, missing=name not in required)
    return found


def _find_advanced(inputs: Sequence[str], sources: Sequence[str]) -> list[int]:
    """Return the places of the inputs that are named as a column that is read one sample early."""
    return [place for place, name in enumerate(inputs) if name.endswith(AT_ONCE) and name != sources[place]]


def _make_record(
    found: UniformRecording,
    sources: Sequence[str],
    output: str | None,
    structures: Mapping[str, str],
    units: Mapping[str, str],
    file: str,
) -> Dataset:
    """Return the record of input columns and an output column, the last one if it is given."""

    def find_unit(name: str) -> str:
        return parse_unit(name.removeprefix(structures[name])) or units.get(name, "")

    return Dataset(
        u=found.values[:, : len(sources)],
        y=np.full(len(found.values), np.nan) if output is None else found.values[:, -1],
        dt=found.dt,
        input_names=tuple(sources),
        output_name=output or "y",
        input_units=tuple(map(find_unit, sources)),
        output_unit="" if output is None else find_unit(output),
        segments=found.segments,
        recordings=(file,) * max(1, len(found.segments)),
        start=found.start,
        reading=found.steps,
    )
