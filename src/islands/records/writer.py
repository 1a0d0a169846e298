"""Writing of records and simulations as CSV with exact numbers."""

import csv
import math
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, check_type
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset

#: Lower and upper limit of a prediction band.
Band = tuple[NDArray[np.float64], NDArray[np.float64]]


def write_record(record: Dataset, path: str | Path) -> None:
    """Write a record of one segment with the columns ``t_s``, the inputs and the output.

    Raises
    ------
    RecordError
        The record has several segments, which a table with one time column cannot represent, or the file
        cannot be written.
    """
    check_type(record, Dataset, "write_record", "make one by as_record(data, inputs=..., output=...)")
    if len(record.segments) > 1:
        raise RecordError("a CSV file holds one recording: write each segment to a separate file")
    names = ("t_s", *record.input_names, record.output_name)
    _write(path, names, zip(_round_times(record), *record.u.T.tolist(), record.y.tolist(), strict=True))


def write_input(u: NDArray[np.float64], dt: float, name: str, path: str | Path) -> None:
    """Write the text of `input_csv` to a file.

    Raises
    ------
    RecordError
        The file cannot be written.
    """
    _write_text(path, input_csv(u, dt, name))


def input_csv(u: NDArray[np.float64], dt: float, name: str) -> str:
    """Return an input as the columns ``t_s`` and its name, such as ``u_V``, which contains its unit.

    Parameters
    ----------
    u : ndarray, shape (samples,)
    dt : float
        Sampling time in seconds.
    """
    times = _round_times(Dataset(u=u, y=np.zeros(u.size), dt=dt))
    return _format(("t_s", name), zip(times, u.tolist(), strict=True))


def write_simulation(
    record: AnyRecord, simulated: NDArray[np.float64], path: str | Path, band: Band | None = None
) -> None:
    """Write the columns ``time`` (s) and ``y_sim``, one row for every sample of the record.

    Several outputs have one column each, such as ``level_cm_sim``.

    Parameters
    ----------
    simulated : ndarray, shape (samples,) or (samples, outputs)
        Simulated outputs. NaN, as in the warm-up, is written as ``nan``.
    band : (ndarray, ndarray), optional
        Limits of a prediction band, written as the columns ``y_low`` and ``y_high`` (``level_cm_low`` ..);
        each has the shape of ``simulated``.
    """
    names = ["y"] if len(record.records) == 1 else record.output_names
    split = [values.reshape(record.samples, -1).T for values in (simulated, *(band or ()))]
    columns = {f"{name}_sim": y for name, y in zip(names, split[0], strict=True)}
    for name, *limits in zip(names, *split[1:], strict=True):
        columns |= {f"{name}_{end}": limit for end, limit in zip(("low", "high"), limits, strict=False)}
    rows = zip(_round_times(record.records[0]), *(each.tolist() for each in columns.values()), strict=True)
    _write(path, ("time", *columns), rows)


def _round_times(record: Dataset) -> list[float]:
    # Twelve digits, or more if a millionth of a sample needs them. Further digits are rounding errors of
    # start + k dt.
    time = record.time
    steps = float(np.abs(time).max()) / record.dt
    digits = min(17, max(12, 7 + math.ceil(math.log10(max(1.0, steps)))))
    return [float(f"{moment:.{digits}g}") for moment in time]


def _write(path: str | Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    _write_text(path, _format(names, rows))


def _format(names: Sequence[str], rows: Iterable[Sequence[float]]) -> str:
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return stream.getvalue()


def _write_text(path: str | Path, text: str) -> None:
    try:
        Path(path).write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}") from error
