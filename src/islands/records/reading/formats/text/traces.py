"""Traces of controllers (CODESYS): keys and values, and a block of samples for each variable.

Each block has the number of its variable: ``0.Variable; PLC_PRG.level`` and, below ``0.Data;``, lines of time
and value, ``; 51; 30.02``. The times are in milliseconds.
"""

import re
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import isfinite

from islands.errors import RecordError
from islands.records.reading.size_limits import MOST_CELLS, check_column_count

#: Name of the column of the times.
_TIME = "t_ms"

_VARIABLE = re.compile(r"\d+\.Variable;(.+)")

#: Parts of the line of a sample, of which the first is blank.
_PARTS = 3

#: Lines that may precede the name of the first variable.
_MOST_LINES = 300


@dataclass(frozen=True, slots=True)
class TraceTable:
    """A trace as a table, whose columns have empty cells at the times of other variables.

    Attributes
    ----------
    names : tuple of str
    cells : list of list of str
        One list for each time.
    numbers : array of int
        Line number of the first sample at each time.
    """

    names: tuple[str, ...]
    cells: list[list[str]]
    numbers: "array[int]"


@dataclass(frozen=True, slots=True)
class _Variable:
    name: str
    samples: list[tuple[float, int, str, str, int]] = field(default_factory=list)


def is_trace(lines: Sequence[str]) -> bool:
    """Return whether one of the first lines names the variable of a block."""
    return any(_VARIABLE.fullmatch(line.strip()) for line in islice(lines, _MOST_LINES))


def read_trace(lines: Sequence[str], file: str) -> TraceTable:
    """Bring the samples of all variables together by their times.

    Parameters
    ----------
    lines : sequence of str
    file : str
        Name of the file, for messages.

    Raises
    ------
    RecordError
        The trace has no samples, or variables of too many different times.
    """
    variables = [variable for variable in _list_variables(lines) if variable.samples]
    if not variables:
        raise RecordError(f"{file} is a trace without samples: export it again after it has run")
    check_column_count(variables, file)
    rows: dict[tuple[float, int], tuple[str, int]] = {}
    for variable in variables:
        for time, repeated, text, _, number in variable.samples:
            rows.setdefault((time, repeated), (text, number))
    if len(rows) * len(variables) > MOST_CELLS:
        raise RecordError(
            f"{file} has {len(variables)} variables with samples at {len(rows)} different times: export fewer"
        )
    places = {key: place for place, key in enumerate(sorted(rows))}
    cells = [[rows[key][0], *[""] * len(variables)] for key in places]
    for column, variable in enumerate(variables, 1):
        for time, repeated, _, value, _ in variable.samples:
            cells[places[time, repeated]][column] = value
    return TraceTable(
        (_TIME, *(variable.name for variable in variables)),
        cells,
        array("q", [rows[key][1] for key in places]),
    )


def _list_variables(lines: Sequence[str]) -> list[_Variable]:
    """Return the variables with their samples: time, how often the time precedes, its text, value, line."""
    variables: list[_Variable] = []
    times: Counter[float] = Counter()
    for number, line in enumerate(lines, 1):
        if named := _VARIABLE.fullmatch(line.strip()):
            variables.append(_Variable(named[1].strip()))
            times.clear()
        elif variables and len(parts := line.split(";")) == _PARTS and not parts[0].strip():
            try:
                time = float(parts[1])
            except ValueError:
                continue
            if not isfinite(time):
                continue
            variables[-1].samples.append((time, times[time], parts[1].strip(), parts[2].strip(), number))
            times[time] += 1
    return variables
