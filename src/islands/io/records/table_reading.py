"""Inputs and an output of an open table, with checks for all that would make an identification fail."""

from collections.abc import Mapping, Sequence

import numpy as np

from islands.data.channel_names import AT_ONCE, parse_unit
from islands.data.dataset import Dataset
from islands.data.input_lead import advance_inputs
from islands.io.records.column_names import find_column, split_structures, time_column
from islands.io.records.reading_options import DEFAULT_READING, ReadingOptions
from islands.io.records.sampling.recording import Recording, UniformRecording
from islands.io.records.sampling.repair import make_uniform
from islands.io.records.sampling.time_step import find_sampling, make_recording
from islands.io.records.table import Table
from islands.io.records.validation import (
    check_choice,
    check_length,
    check_repaired,
    check_values,
    check_varies,
)


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
) -> Dataset:
    """Read inputs and an output from an open table and check them.

    Parameters
    ----------
    table : Table
    file : str
        Name of the table in messages.
    inputs, output, dt, rows, missing_output
        As in `islands.io.records.reader.read_record`.
    options : ReadingOptions
        The time column, and the repair of irregular sampling.
    resting_inputs : bool
        Accept constant inputs.

    Raises
    ------
    RecordError
        The record cannot be used as it is.
    """
    inputs = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    sources = [find_column(name, table.names) for name in inputs]
    output = None if output is None else find_column(output, table.names)
    outputs = () if output is None else (output,)
    chosen = (*sources, *outputs)
    check_choice(table.names, sources, output, file, options.time, table.others)
    structures = split_structures(table.names)
    structure = structures[chosen[-1]]
    clock = options.time or time_column(table.names, file, chosen, structure, table.clocks)
    columns = table.read(tuple(dict.fromkeys((*chosen, *([clock] if clock else [])))), rows)
    # A simulation needs no more samples than the lags of its model, which it checks.
    check_length(columns, *([2] if missing_output else []))
    required = [name for name in columns.numbers if not (missing_output and name == output)]
    if options.gaps is None:
        for name in columns.numbers:
            check_values(columns, name, missing=name == output)
    values = np.column_stack([columns.numbers[name] for name in chosen])
    if options.gaps is None and options.resample is None:
        step, start = find_sampling(table, columns, clock, dt, structure, options.time is not None)
        found = UniformRecording(values, step, step * columns.first if start is None else start, (), ())
    else:
        recording = make_recording(table, columns, values, clock, dt, structure, options.time is not None)
        found = _repair(recording, chosen, required, options, file)
    for name in () if missing_output else (*(() if resting_inputs else sources), *outputs):
        check_varies(columns, name)
    record = _make_record(found, sources, output, structures, file)
    return advance_inputs(record, _find_advanced(inputs, sources))


def _repair(
    recording: Recording,
    chosen: Sequence[str],
    required: Sequence[str],
    options: ReadingOptions,
    file: str,
) -> UniformRecording:
    """Make the sampling uniform, and check the columns; those that are not required may lack values."""
    places = [place for place, name in enumerate(chosen) if name in required]
    found = make_uniform(recording, places, options.gaps, options.resample)
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
    file: str,
) -> Dataset:
    """Return the record of input columns and an output column, the last one if it is given."""
    return Dataset(
        u=found.values[:, : len(sources)],
        y=np.full(len(found.values), np.nan) if output is None else found.values[:, -1],
        dt=found.dt,
        input_names=tuple(sources),
        output_name=output or "y",
        input_units=tuple(parse_unit(source.removeprefix(structures[source])) for source in sources),
        output_unit="" if output is None else parse_unit(output.removeprefix(structures[output])),
        segments=found.segments,
        recordings=(file,) * max(1, len(found.segments)),
        start=found.start,
        reading=found.steps,
    )
