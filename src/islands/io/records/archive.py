"""NumPy archives (.npz): one array per column, and the sampling time as an array of one number."""

import lzma
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.io.records.table import Columns, Rows, select

#: Names, in lower case, under which an archive states its sampling, and the sampling time in seconds.
SAMPLING: dict[str, Callable[[float], float]] = {
    "dt": lambda seconds: seconds,
    "ts": lambda seconds: seconds,
    "fs": lambda hertz: 1.0 / hertz,
}

#: What NumPy and the standard library raise on damaged archives, and on Python objects in sound ones.
UNREADABLE = (
    ValueError,
    OSError,
    EOFError,
    RuntimeError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
)


@dataclass(frozen=True, slots=True, eq=False)
class Archive:
    """A NumPy archive; an array is loaded when it is asked for.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Names of the arrays.
    stated : mapping of str to float
        Sampling times in seconds that stand in the archive: ``{"array fs": 0.001}``.
    """

    path: Path
    names: tuple[str, ...]
    stated: Mapping[str, float]

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named arrays over the selected rows; see `islands.io.records.table.Table`."""
        file = self.path.name
        channels = {name: _channel(self.path, name) for name in names}
        first = names[0]
        for name, channel in channels.items():
            if len(channel) != len(channels[first]):
                raise RecordError(
                    f"{file}: column {first} has {len(channels[first])} samples, column {name} "
                    f"{len(channel)}: channels of one record are of equal length"
                )
        chosen = select(rows, len(channels[first]), file)
        return Columns(
            Rows(file, "sample", chosen),
            {name: channel[chosen.start : chosen.stop] for name, channel in channels.items()},
            chosen.start,
        )


def read_archive(path: Path) -> Archive:
    """Open a NumPy archive and read the sampling time that it states.

    Raises
    ------
    RecordError
        The file is no archive, or what it states as its sampling is not a positive number.
    """
    if path.stat().st_size == 0:
        raise RecordError(f"{path.name} is empty: write it anew with numpy.savez")
    if not zipfile.is_zipfile(path):
        raise RecordError(f"{path.name} is not a NumPy archive: write it with numpy.savez(path, u=u, y=y)")
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            names = tuple(archive.files)
    except UNREADABLE as error:
        raise RecordError(f"{path.name} is damaged ({error}): write it anew with numpy.savez") from error
    stated: dict[str, float] = {}
    for name in names:
        array = _array(path, name) if name.lower() in SAMPLING else np.empty(0)
        if array.size == 1:
            stated[f"array {name}"] = _sampling_time(array, name, path.name)
    return Archive(path, names, stated)


def _sampling_time(array: NDArray[Any], name: str, file: str) -> float:
    value = float(array.item()) if array.dtype.kind in "fiu" else float("nan")
    if not (np.isfinite(value) and value > 0):
        raise RecordError(
            f"{file}: array {name} states the sampling as {array.item()!r}: it is a positive number, "
            "dt and Ts in seconds, fs in hertz"
        )
    return SAMPLING[name.lower()](value)


def _array(path: Path, name: str) -> NDArray[Any]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return np.asarray(archive[name])
    except UNREADABLE as error:
        raise RecordError(
            f"{path.name}: column {name} cannot be read ({error}): if it holds Python objects, which may run "
            "code, save it as numpy.asarray(values, float); otherwise the file is damaged, write it anew"
        ) from error


def _channel(path: Path, name: str) -> NDArray[np.float64]:
    array = _array(path, name)
    if array.dtype.kind not in "fiub":
        raise RecordError(f"{path.name}: column {name} holds {array.dtype} where real numbers are expected")
    if not (array.ndim == 1 or (array.ndim == 2 and 1 in array.shape)):
        raise RecordError(
            f"{path.name}: column {name} has the shape {array.shape}, a channel has (samples,): save one "
            "array per channel and recording"
        )
    return array.ravel().astype(np.float64)
