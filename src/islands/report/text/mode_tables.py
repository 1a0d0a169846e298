"""Tables of the modes and of the gains of a linear system, for the summary and for the report."""

from collections.abc import Mapping, Sequence
from math import floor, log10
from typing import Any

#: Headings of both tables.
MODES, GAINS = ("mode", "value", "damping ratio"), ("gain", "value")

#: Digits of a value without a standard error.
_DIGITS = 5


def list_modes(quantities: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return the row of every mode: a resonance with its damping ratio, or a time constant.

    Parameters
    ----------
    quantities : sequence of mapping
        ``quantities`` of a model of several outputs in ``result.json``.
    """
    rows: list[tuple[str, ...]] = []
    for each in quantities:
        if each["input"] is not None:
            continue
        if each["name"] == "damping ratio":
            rows[-1] = (*rows[-1][:2], _write(each))
        else:
            name = "resonance" if each["name"] == "frequency" else each["name"]
            rows.append((name, _write(each), ""))
    return rows


def list_gains(
    quantities: Sequence[Mapping[str, Any]], inputs: Sequence[str], outputs: Sequence[str]
) -> list[tuple[str, ...]]:
    """Return the row of every gain and dead time of an input and an output; see `list_modes`."""
    return [
        (f"{each['name']} of {inputs[each['input'] - 1]} on {outputs[each['output'] - 1]}", _write(each))
        for each in quantities
        if each["input"] is not None
    ]


def align(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines of text; the columns after the first are aligned to the right."""
    lines = [headings, *rows]
    first, *others = (max(map(len, column)) for column in zip(*lines, strict=True))
    return [
        "  ".join(
            [line[0].ljust(first), *(cell.rjust(width) for cell, width in zip(line[1:], others, strict=True))]
        ).rstrip()
        for line in lines
    ]


def _write(quantity: Mapping[str, Any]) -> str:
    """Write a value to the second digit of its standard error."""
    value, error = quantity["value"], quantity["standard_error"]
    if value is None:
        return "infinite"
    if not error:
        return f"{value:.{_DIGITS}g} {quantity['unit']}".rstrip()
    decimals = max(0, 1 - floor(log10(error)))
    return f"{value:.{decimals}f} +- {error:.{decimals}f} {quantity['unit']}".rstrip()
