"""Reading of whole columns of an untrusted file, for plots, in a confined subprocess."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError, suggest
from islands_service.intake.confined_answer import open_answer
from islands_service.intake.confined_process import enter, refuse

#: Numbers as they are sent.
_FLOAT = np.dtype("<f8")


def read_columns(
    path: Path, names: Sequence[str], reading: Mapping[str, Any], memory: int, seconds: float
) -> NDArray[np.float64]:
    """Read columns of a file in a confined subprocess.

    Parameters
    ----------
    names : sequence of str
    reading : mapping
        Options of `islands.records.reading.options.ReadingOptions` that differ from the default.
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Returns
    -------
    columns : ndarray, shape (columns, samples)
        Missing values are NaN.

    Raises
    ------
    RecordError
        There is no such column, or it contains text.
    MemoryError
        The subprocess was killed, as the kernel does if the machine has too little memory.
    """
    asked = {"names": list(names), "reading": dict(reading)}
    with open_answer("sample_reading", path, asked, memory, seconds) as answer:
        received = answer.read()
    if len(received) % (len(names) * _FLOAT.itemsize):
        raise RecordError("the process that reads columns has answered nonsense")
    return np.frombuffer(received, _FLOAT).reshape(len(names), -1)


def find_columns(path: Path, names: Sequence[str], reading: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return columns of a file in this process; see `read_columns`.

    Raises
    ------
    RecordError, SettingsError
        A column does not exist, or it contains text.
    """
    # Only the process that reads files imports its readers.
    from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
    from islands.records.reading.reader import open_record  # noqa: PLC0415

    table = open_record(path, ReadingOptions(**reading))
    for name in names:
        if name not in table.names:
            known = f"it has {', '.join(table.names)}{suggest(name, table.names)}"
            raise RecordError(f"{path.name} has no column {name}; {known}")
    numbers = table.read(names, None).numbers
    return np.array([numbers[name] for name in names], _FLOAT)


def main() -> None:
    """Read the file named on standard input, and write its columns to standard output."""
    path, asked, answer = enter(writes=True)
    try:
        columns = find_columns(Path(path), asked["names"], asked["reading"])
    except (RecordError, SettingsError) as error:
        refuse(error, answer)
    answer.write(columns.tobytes())
    answer.flush()
