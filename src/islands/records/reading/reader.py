"""Reading of records from files, with checks for everything that would make an identification fail later."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from islands.errors import RecordError, SettingsError
from islands.records.coupled import AnyRecord, couple, join_columns
from islands.records.dataset import Dataset
from islands.records.reading.column_names import list_inputs, take_outputs
from islands.records.reading.content import find_suffix
from islands.records.reading.formats.excel import read_workbook
from islands.records.reading.formats.hdf5 import read_hdf5
from islands.records.reading.formats.mat.file import read_matlab
from islands.records.reading.formats.mdf import read_mdf
from islands.records.reading.formats.npz import read_archive
from islands.records.reading.formats.packed import PACKED, open_packed
from islands.records.reading.formats.parquet import read_parquet
from islands.records.reading.formats.tdms import read_tdms
from islands.records.reading.formats.text.table import DelimitedText, read_delimited
from islands.records.reading.open_table import read_table
from islands.records.reading.options import DEFAULT_READING, EXCLUDE, ReadingOptions, split_words
from islands.records.reading.table import Table

#: Readers by file suffix. To add a format, write a reader and add an entry.
READERS: dict[str, Callable[[Path, ReadingOptions], Table]] = {
    ".csv": read_delimited,
    ".txt": read_delimited,
    ".tsv": read_delimited,
    ".dat": read_delimited,
    ".asc": read_delimited,
    ".lvm": read_delimited,
    ".npz": read_archive,
    ".mat": read_matlab,
    ".parquet": read_parquet,
    ".xlsx": read_workbook,
    ".xlsm": read_workbook,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mf4": read_mdf,
    ".mdf": read_mdf,
    ".tdms": read_tdms,
}


def read_record(
    path: str | Path,
    inputs: Sequence[str],
    output: str | Sequence[str] | None,
    dt: float | None = None,
    rows: slice | None = None,
    missing_output: bool = False,
    *,
    names: Sequence[str] = (),
    header: bool = True,
    time: str | None = None,
    time_unit: str | None = None,
    sheet: str | None = None,
    decimal: str | None = None,
    dates: str | None = None,
    timezone: str | None = None,
    resample: float | None = None,
    missing: Sequence[str] = (),
    gaps: str | None = None,
    outliers: str = EXCLUDE,
    rates: str | None = None,
    resting_inputs: bool = False,
) -> AnyRecord:
    """Read inputs and an output, or several, from a file and check them.

    The formats are text (CSV), XLSX, NPZ, MAT, HDF5, Parquet, MDF and TDMS; a file may be compressed as
    ``.gz`` or ``.zip``. A column named ``t``, ``t_*``, ``time*`` or ``Zeit*`` that is not chosen is the time,
    in the unit of its name (s, ms, us, ns, min, h; s by default). A column of time stamps is the time if no
    other is. The unit of a column is the end of its name: ``u_V``, ``u [V]`` or ``u/V``. Encoding, header,
    row of units, separator, decimal comma and separators of thousands of a text file are inferred. In a
    MAT-file, a field of a structure is the column ``run.u``, its time ``run.t``; a matrix ``x`` of a few
    channels gives the columns ``x_1, x_2 ...``.

    A model reads past inputs only. If the output responds within the sample (a band-limited input sampled at
    the same instants), name the input ``u_V+1``: it is read one sample early, so that its u(k-1) is the input
    at k. The name is stored with the model, which therefore reads other records in the same way.

    Parameters
    ----------
    path : str or Path
        The file. Its suffix selects the reader from `READERS`.
    inputs : sequence of str
        Names of the input columns, in the order of the model's inputs; ``u_V+1`` reads the column u_V one
        sample early, ``u`` the column ``u [V]``.
    output : str, sequence of str or None
        Name of the output column, or names of several. None for an input without data, as `plan_experiment`
        takes it: all values of the output are then missing.
    dt : float, optional
        Sampling time in seconds, for files that do not contain it. If the file contains it, both must agree
        within 1 %; time stamps with jitter or few digits are then replaced. An NPZ or MAT file may contain it
        as a single number ``dt`` or ``Ts`` (seconds) or ``fs`` (hertz).
    rows : slice, optional
        Samples to read, counted from 0 without the header. Samples outside are not checked.
    missing_output : bool
        Accept an output without any value, which a free run needs in its warm-up only, and constant channels:
        a constant input can be simulated, although nothing can be estimated from it. Single missing outputs
        are always accepted: estimation and validation skip them.
    names : sequence of str, optional
        Names of the columns of a table without a header, or in place of its header.
    header : bool
        Whether a table has a header. Without one and without ``names``, the columns are c1, c2, ...
    time : str, optional
        The time column, if its name does not tell. Without a unit it is in seconds.
    time_unit : str, optional
        Unit of the numbers of the time column: ``s``, ``ms``, ``us``, ``ns``, ``min``, ``h`` or ``d``. By
        default that of its name, or of a known count: days of Excel and MATLAB, seconds of LabVIEW, seconds
        to nanoseconds of Unix, ticks of Windows. ``reading`` of the record then states it.
    sheet : str, optional
        Sheet of a workbook, or group of an HDF5, MDF or TDMS file; by default the first with a table.
    decimal : str, optional
        Decimal mark, ``point`` or ``comma``; by default inferred from all numbers.
    dates : str, optional
        ``day-first`` or ``month-first`` for dates such as 3/4/2026; by default inferred from all dates.
    timezone : str, optional
        Time zone of time stamps without an offset, such as ``Europe/Berlin``, for changes to summer time.
    resample : float, optional
        Sampling time in seconds of a new uniform grid, by linear interpolation; before a coarser grid a
        low-pass filter removes frequencies above half of the new rate.
    missing : sequence of str, optional
        Words and numbers in cells that mean a missing value (``"Failed"``, ``"-9999"``), in addition to those
        that are known: ``OL``, ``#DIV/0!``, ``Bad Input``, ``No Data``, ``?`` and others.
    gaps : str, optional
        For gaps in the time and missing values: ``split`` makes each part a segment, ``interpolate`` fills
        them linearly.
    outliers : str
        ``exclude`` treats gross errors of the output as missing values: isolated spikes, codes of missing
        values such as -9999, and parts in which a sensor is stuck. ``keep`` uses them.
    rates : str, optional
        For columns that are sampled less often than the rows, with empty cells or the last value between
        their samples. By default the record has the samples of the slowest column. An input with more samples
        is the ``mean`` from each of them to the next, or, if it predicts the output much better, the
        ``sample`` at each of them. ``rows`` takes every row as a sample of every column.
    resting_inputs : bool
        Accept constant inputs, as of a creep test. A diagnosis can use such a record, an identification
        cannot.

    Returns
    -------
    Dataset or CoupledRecord
        A `CoupledRecord`, which has one `Dataset` for each output, of several outputs. The arrays are
        float64 with the columns' names and units; ``start`` is the time of the first sample; ``reading``
        states what was assumed about the time, and what ``resample``, ``gaps``, ``outliers`` and
        ``rates`` have done.

    Raises
    ------
    RecordError
        The record cannot be used as it is. The message names the row and the column and says what to do.
    SettingsError
        An option is invalid.
    """
    options = ReadingOptions(
        names=split_words(names),
        header=header,
        time=time,
        time_unit=time_unit,
        sheet=sheet,
        decimal=decimal,
        dates=dates,
        timezone=timezone,
        resample=resample,
        missing=split_words(missing),
        gaps=gaps,
        outliers=outliers,
        rates=rates,
    )
    outputs = take_outputs(output)
    columns, first = join_columns(list_inputs(inputs), outputs)
    record = read_dataset(path, columns, first, dt, rows, missing_output, options, resting_inputs)
    return couple(record, len(outputs))


def read_dataset(
    path: str | Path,
    inputs: Sequence[str],
    output: str | None,
    dt: float | None = None,
    rows: slice | None = None,
    missing_output: bool = False,
    options: ReadingOptions = DEFAULT_READING,
    resting_inputs: bool = False,
    signals: Sequence[str] = (),
) -> Dataset:
    """Read a record like `read_record`, with the options as one value; ``signals`` is as in `read_table`."""
    table, file = open_record(path, options), Path(path).name
    record = read_table(
        *(table, file, inputs, output, dt, rows, missing_output, options, resting_inputs, signals)
    )
    return replace(record, sha256=fingerprint(path))


def read_columns(path: str | Path, options: ReadingOptions = DEFAULT_READING) -> tuple[str, ...]:
    """Return the names of the columns (NPZ and MAT: arrays) of a file, in the file's order.

    Raises
    ------
    RecordError
        The file does not exist or cannot be read.
    """
    return open_record(path, options).names


def fingerprint(path: str | Path) -> str:
    """Return the SHA-256 of the file's bytes in hexadecimal. Equal fingerprints mean equal data.

    Raises
    ------
    RecordError
        The file does not exist or cannot be read.
    """
    with _check_readable(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def open_record(path: str | Path, options: ReadingOptions = DEFAULT_READING) -> Table:
    """Open a file with the reader for its content, or for its suffix.

    Text is read as a table whatever the name of the file.

    Raises
    ------
    RecordError
        The file does not exist, cannot be read, or has no format of `READERS`.
    """
    file = _check_readable(path)
    if file.suffix.lower() in PACKED:
        return open_packed(file, READERS, partial(_open_file, options=options))
    return _open_file(file, options)


def _open_file(file: Path, options: ReadingOptions) -> Table:
    texts = [suffix for suffix, reader in READERS.items() if reader is read_delimited]
    suffix = find_suffix(file, READERS, texts, options)
    table = READERS[suffix](file, options)
    own = file.suffix.lower()
    if isinstance(table, DelimitedText) and suffix != own and own in {*READERS, ".xls"}:
        table = replace(table, notes=(f"{file.name} is text and is read as a table of text", *table.notes))
    return table


def _check_readable(path: str | Path) -> Path:
    if not (isinstance(path, str) or hasattr(path, "__fspath__")):
        raise SettingsError(
            f"read_record takes the path of a file, got a {type(path).__name__}: data in memory are read by "
            "as_record(data, inputs=..., output=...)"
        )
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
