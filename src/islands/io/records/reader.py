"""Reading of records from files, with checks for everything that would make an identification fail later."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from islands.data.channel_names import parse_unit
from islands.data.dataset import Dataset
from islands.data.input_lead import advance_inputs
from islands.errors import RecordError
from islands.io.records.column_names import find_column, split_structures, time_column
from islands.io.records.mat.mat_file import read_matlab
from islands.io.records.npz import read_archive
from islands.io.records.parquet import read_parquet
from islands.io.records.sampling import find_sampling
from islands.io.records.table import Table
from islands.io.records.text.text_table import read_delimited
from islands.io.records.validation import check_choice, check_length, check_values, check_varies

#: Readers by file suffix. To add a format, write a reader and add an entry.
READERS: dict[str, Callable[[Path], Table]] = {
    ".csv": read_delimited,
    ".txt": read_delimited,
    ".tsv": read_delimited,
    ".dat": read_delimited,
    ".npz": read_archive,
    ".mat": read_matlab,
    ".parquet": read_parquet,
}


def read_record(
    path: str | Path,
    inputs: Sequence[str],
    output: str,
    dt: float | None = None,
    rows: slice | None = None,
    missing_output: bool = False,
) -> Dataset:
    """Read inputs and an output from a file (CSV, NPZ, MAT or Parquet) and check them.

    A column named ``t``, ``t_*``, ``time*`` or ``Zeit*`` that is neither input nor output is the time, in the
    unit of its name (s, ms, us, ns, min, h; s by default). The unit of a column is the end of its name:
    ``u_V``, ``u [V]`` or ``u/V``. Encoding, header, row of units, separator and decimal comma of a text file
    are inferred. In a MAT-file, a field
    of a structure is the column ``run.u``, its time ``run.t``; a matrix ``x`` of a few channels gives the
    columns ``x_1, x_2 ...``.

    A model reads past inputs only. If the output responds within the sample (a band-limited input sampled at
    the same instants), name the input ``u_V+1``: it is read one sample early, so that its u(k-1) is the input
    at k. The name is stored with the model, which therefore reads other records in the same way.

    Parameters
    ----------
    path : str or Path
        The file. Its suffix selects the reader from `READERS`.
    inputs : sequence of str
        Names of the input columns, in the order of the model's inputs; ``u_V+1`` reads the column u_V one
        sample early.
    output : str
        Name of the output column.
    dt : float, optional
        Sampling time in seconds, for files that do not contain it. If the file contains it, both must agree
        within 1 %. An NPZ or MAT file may contain it as a single number ``dt`` or ``Ts`` (seconds) or ``fs``
        (hertz).
    rows : slice, optional
        Samples to read, counted from 0 without the header. Samples outside are not checked.
    missing_output : bool
        Accept an output with missing values, which a free run needs in its warm-up only, and constant
        channels: a constant input can be simulated, although nothing can be estimated from it.

    Returns
    -------
    Dataset
        One segment of float64 with the columns' names and units; ``start`` is the time of the first sample.

    Raises
    ------
    RecordError
        The record cannot be used as it is. The message names the row and the column and says what to do.
    """
    record = read_table(open_record(path), Path(path).name, inputs, output, dt, rows, missing_output)
    return replace(record, sha256=fingerprint(path))


def read_table(
    table: Table,
    file: str,
    inputs: Sequence[str],
    output: str,
    dt: float | None = None,
    rows: slice | None = None,
    missing_output: bool = False,
) -> Dataset:
    """Read inputs and an output from an open table and check them.

    Parameters
    ----------
    table : Table
    file : str
        Name of the table in messages.
    inputs, output, dt, rows, missing_output
        As in `read_record`.

    Raises
    ------
    RecordError
        As in `read_record`.
    """
    inputs = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    sources = [find_column(name, table.names) for name in inputs]
    check_choice(table.names, sources, output, file)
    structures = split_structures(table.names)
    time = time_column(table.names, file, (*sources, output), structures[output])
    columns = table.read((*sources, output, *([time] if time else [])), rows)
    check_length(columns)
    for name in columns.numbers:
        check_values(columns, name, missing=missing_output and name == output)
    step, start = find_sampling(table, columns, time, dt, structures[output])
    for name in () if missing_output else (*sources, output):
        check_varies(columns, name)
    record = Dataset(
        u=np.column_stack([columns.numbers[source] for source in sources]),
        y=columns.numbers[output],
        dt=step,
        input_names=tuple(sources),
        output_name=output,
        input_units=tuple(parse_unit(source.removeprefix(structures[source])) for source in sources),
        output_unit=parse_unit(output.removeprefix(structures[output])),
        recordings=(file,),
        start=step * columns.first if start is None else start,
    )
    return advance_inputs(record, [place for place, name in enumerate(inputs) if name != sources[place]])


def read_columns(path: str | Path) -> tuple[str, ...]:
    """Return the names of the columns (NPZ and MAT: arrays) of a file, in the file's order.

    Raises
    ------
    RecordError
        The file does not exist or cannot be read.
    """
    return open_record(path).names


def fingerprint(path: str | Path) -> str:
    """Return the SHA-256 of the file's bytes in hexadecimal. Equal fingerprints mean equal data.

    Raises
    ------
    RecordError
        The file does not exist or cannot be read.
    """
    with _check_readable(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def open_record(path: str | Path) -> Table:
    """Open a file with the reader for its suffix.

    Raises
    ------
    RecordError
        The file does not exist, cannot be read, or its suffix is not in `READERS`.
    """
    file = _check_readable(path)
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise RecordError(
            f"{file.name}: files ending in '{file.suffix}' are not supported, only {', '.join(READERS)}: "
            "export the record to one of these"
        )
    return reader(file)


def _check_readable(path: str | Path) -> Path:
    file = Path(path)
    try:
        file.open("rb").close()
    except FileNotFoundError as error:
        raise RecordError(
            f"there is no file {file}: check the path and the folder that it is relative to"
        ) from error
    except OSError as error:
        if file.is_dir():
            raise RecordError(f"{file} is a folder: give the path of the file in it") from error
        raise RecordError(
            f"{file} cannot be opened ({error.strerror}): check path and permissions"
        ) from error
    return file
