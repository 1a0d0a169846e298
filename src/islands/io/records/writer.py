"""Records and simulations as CSV, every number so that it is read back exactly."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError


def write_record(record: Dataset, path: str | Path) -> None:
    """Write a record of one segment with the columns ``t_s``, the inputs and the output.

    Raises
    ------
    RecordError
        The record has several segments, which a table with one time column cannot show; or the file cannot be
        written.
    """
    if len(record.segments) > 1:
        raise RecordError("a CSV holds one recording: write each segment to a file of its own")
    names = ("t_s", *record.input_names, record.output_name)
    _write(path, names, zip(_times(record), *record.u.T.tolist(), record.y.tolist(), strict=True))


def write_simulation(record: Dataset, simulated: NDArray[np.float64], path: str | Path) -> None:
    """Write the columns ``time`` (s) and ``y_sim``, one row for every sample of the record.

    Parameters
    ----------
    simulated : ndarray, shape (samples,)
        NaN is written as ``nan``: the warm-up has no prediction.
    """
    _write(path, ("time", "y_sim"), zip(_times(record), simulated.tolist(), strict=True))


def _times(record: Dataset) -> list[float]:
    # Twelve digits, or more where a millionth of a sample takes them: what lies behind is the rounding of
    # start + k dt.
    time = record.time
    steps = float(np.abs(time).max()) / record.dt
    digits = min(17, max(12, 7 + math.ceil(math.log10(max(1.0, steps)))))
    return [float(f"{moment:.{digits}g}") for moment in time]


def _write(path: str | Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    try:
        with Path(path).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(names)
            writer.writerows(rows)
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}") from error
