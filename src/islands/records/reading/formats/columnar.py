"""Files with one array per column: the common part of NumPy archives, MAT-files and Parquet."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from reprlib import repr as abbreviate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.channel_names import is_unit
from islands.records.reading.column_names import split_structures
from islands.records.reading.formats.text.missing_words import parse_words
from islands.records.reading.formats.text.number_parsing import parse_numbers, remove_numbers
from islands.records.reading.formats.text.quantities import find_unit
from islands.records.reading.formats.text.states import find_states
from islands.records.reading.formats.text.table_start import is_value
from islands.records.reading.table import Columns, RowRange, select
from islands.records.reading.validation import check_equal_length

#: Names, in lower case, of arrays that state the sampling, with the conversion to seconds.
SAMPLING: dict[str, Callable[[float], float]] = {
    "dt": lambda seconds: seconds,
    "ts": lambda seconds: seconds,
    "fs": lambda hertz: 1.0 / hertz,
}


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class ColumnarFile:
    """A file of arrays. Arrays are loaded on demand.

    Attributes
    ----------
    file : str
        The file's name.
    names : tuple of str
        Names of the arrays.
    load : callable
        Returns the array with a given name as stored in the file; raises `RecordError`.
    scalars : sequence of str
        Arrays that may be single numbers. Those with a name in `SAMPLING` state the sampling.
    clocks, others
        See `islands.records.reading.table.Table`.
    missing : tuple of str
        Words and numbers that mean a missing value, as in
        `islands.records.reading.options.ReadingOptions`.
    """

    file: str
    names: tuple[str, ...]
    load: Callable[[str], NDArray[Any]]
    scalars: Sequence[str] = ()
    clocks: Mapping[str, str] = field(default_factory=dict)
    others: str = ""
    missing: tuple[str, ...] = ()

    def stated(self, structure: str) -> Mapping[str, float]:
        """Return the sampling times stated in the file; see `islands.records.reading.table.Table`."""
        structures = split_structures(self.names)
        stated: dict[str, float] = {}
        for scope in dict.fromkeys((structure, "")):
            for name in self.scalars:
                field = name.removeprefix(scope).lower()
                convert = SAMPLING.get(field) if structures[name] == scope else None
                array = np.empty(0) if convert is None else self.load(name)
                if convert is not None and array.size == 1:
                    stated[name] = convert(_check_positive(array, name, self.file))
            if stated:
                break
        return stated

    def read(self, names: Sequence[str], rows: slice | None) -> Columns:
        """Convert the named arrays over the selected rows; see `islands.records.reading.table.Table`."""
        found = {name: self._to_channel(self.load(name), name) for name in names}
        channels = {name: channel for name, (channel, _, _) in found.items()}
        check_equal_length({name: len(channel) for name, channel in channels.items()}, self.file)
        chosen = select(rows, len(channels[names[0]]), self.file)
        return Columns(
            RowRange(self.file, "sample", chosen),
            {name: channel[chosen.start : chosen.stop] for name, channel in channels.items()},
            chosen.start,
            frozenset(name for name in names if name in self.clocks),
            notes=tuple(note for _, notes, _ in found.values() for note in notes),
            units={name: unit for name, (_, _, unit) in found.items() if unit},
        )

    def _to_channel(self, array: NDArray[Any], name: str) -> tuple[NDArray[np.float64], tuple[str, ...], str]:
        """Convert an array, in which texts may be numbers; return what was assumed and the unit."""
        missing = parse_words(self.missing)
        rows = RowRange(self.file, "sample", range(array.size))
        texts = _list_texts(array)
        if texts is not None and (any(map(is_value, texts)) or find_states(texts)):
            unit = find_unit(texts, missing.texts)
            parsed = parse_numbers({name: texts}, rows, missing=missing, units={name: unit} if unit else {})
            return parsed.numbers[name], parsed.notes, unit if is_unit(unit) else ""
        channel = _to_channel(array, name, self.file)
        return *remove_numbers(channel, name, missing.numbers, rows), ""

    def remarks(self, names: Sequence[str]) -> tuple[str, ...]:  # noqa: ARG002
        """Return which table of the file is read; nothing is inferred from arrays."""
        return (self.others,) if self.others else ()


def _check_positive(array: NDArray[Any], name: str, file: str) -> float:
    value = float(array.item()) if array.dtype.kind in "fiu" else float("nan")
    if not (np.isfinite(value) and value > 0):
        raise RecordError(
            f"{file}: array {name} states the sampling as {array.item()!r}: it must be a positive number, "
            "dt and Ts in seconds, fs in hertz"
        )
    return value


def _list_texts(array: NDArray[Any]) -> list[str] | None:
    """Return an array of texts, numbers and None as cells; None for another array."""
    if array.dtype.kind not in "OUT" or array.ndim != 1:
        return None
    values = array.tolist()
    if not any(isinstance(value, str) for value in values):
        return None
    known = (str, float, int, type(None))
    if not all(isinstance(value, known) for value in values):
        return None
    return ["" if value is None else str(value) for value in values]


def _to_channel(array: NDArray[Any], name: str, file: str) -> NDArray[np.float64]:
    if array.dtype.kind == "O" and all(value is None or isinstance(value, Real) for value in array.flat):
        array = np.array([np.nan if value is None else value for value in array.flat], np.float64)
    if array.dtype.kind not in "fiub":
        texts = _list_texts(array)
        found = str(array.dtype)
        if texts is not None:
            sample = next((place for place, text in enumerate(texts) if text), 0)
            found = f"text ({abbreviate(texts[sample])} in sample {sample})"
        raise RecordError(f"{file}: column {name} holds {found} where real numbers are expected")
    if not (array.ndim == 1 or (array.ndim == 2 and 1 in array.shape)):
        raise RecordError(
            f"{file}: column {name} has the shape {array.shape}, a channel has (samples,): save one "
            "array per channel and recording"
        )
    with np.errstate(invalid="ignore"):  # the conversion turns signalling NaNs into quiet ones
        return array.ravel().astype(np.float64)
