"""Families of text files that are costly to read, each of any size, and the measurement of their reading.

A file of a family is read or refused in a time that grows in proportion to its size.
"""

import gc
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from islands.errors import IslandsError

#: Header and first samples of a valid table, before the part that is costly.
_HEAD = "t_s,u_V,y_um\n"
_SAMPLES = "".join(f"{k / 100:g},{k % 7 - 3},{k * k % 11}.5\n" for k in range(60))


def _fill(unit: str) -> Callable[[int], str]:
    """Return a family that is a valid table followed by repetitions of a text."""
    return lambda size: _HEAD + _SAMPLES + unit * (size // len(unit.encode()))


def _fill_only(unit: str, end: str = "", begin: str = "") -> Callable[[int], str]:
    """Return a family that consists of repetitions of a text, with a beginning and an end."""
    return lambda size: begin + unit * (size // len(unit.encode())) + end


def _fill_cell(unit: str, end: str = "") -> Callable[[int], str]:
    """Return a family with one long cell in an otherwise valid table."""
    return lambda size: f"{_HEAD}{_SAMPLES}0.60,{unit * (size // len(unit.encode()))}{end},1\n"


def _fill_cells(cell: str, length: int, end: str = "") -> Callable[[int], str]:
    """Return a family of a valid table whose cells repeat a text to a length."""
    text = cell * (length // len(cell)) + end
    row = f",{text},1\n"

    def write(size: int) -> str:
        return _HEAD + _SAMPLES + "".join(f"{k / 100:g}{row}" for k in range(60, 60 + size // (len(row) + 5)))

    return write


def _widen(cells: int) -> Callable[[int], str]:
    """Return a family of tables with a number of columns in proportion to the size, and few samples."""

    def write(size: int) -> str:
        width = size // cells
        names = ",".join(f"c{number}" for number in range(width))
        return "\n".join([names, *(",".join([str(k % 7)] * width) for k in range(40))])

    return write


def _describe(line: str, lines: int = 300) -> Callable[[int], str]:
    """Return a family of many long lines before a table."""

    def write(size: int) -> str:
        each = line * (size // lines // len(line))
        return f"{each}\n" * lines + _HEAD + _SAMPLES

    return write


def _shorten(size: int) -> str:
    """Write a header with many names above lines with few cells."""
    return ",".join(f"n{number}" for number in range(size // 20)) + "\n" + "1\n2,3\n" * (size // 12)


#: Writers of the families by name; each takes the size in bytes, which it meets to a few percent.
FAMILIES: dict[str, Callable[[int], str]] = {
    "digits in a cell": _fill_cell("1"),
    "digits that are not a number": _fill_cell("1", "x"),
    "groups of digits": _fill_cell("'123", "x"),
    "a long exponent": _fill_cell("9", "e9"),
    "exponents": _fill_cells("1e999999999", 11),
    "negative exponents": _fill_cells("1e-999999999", 12),
    "blanks in a cell": _fill_cell(" ", "x"),
    "digits in all cells": _fill_cells("1", 800),
    "digits in a cell of other digits": _fill_cells("\N{ARABIC-INDIC DIGIT THREE}", 400, "x"),
    "other digits": _fill_cells("\N{ARABIC-INDIC DIGIT THREE}", 3),
    "dates": _fill_cells("2026-11-22 14:05:03.25", 22),
    "text like dates": _fill_cells("22-Nov-2026 14:05:03 PM +01:00 ", 600, "x"),
    "only dates": _fill_only("2026-11-22,14:05:03,22.11.26,11/22/2026\n"),
    "separators": _fill(","),
    "only separators": _fill_only(",", "\n"),
    "mixed separators": _fill_only(";\t|, ", "\n"),
    "lines of separators": _fill_only(",,,,;;;\t\t|\n"),
    "quotes": _fill('"'),
    "only quotes": _fill_only('"'),
    "quotes and separators": _fill_only('",'),
    "a quote that is never closed": _fill('"1,2,3\n'),
    "a quote in the header that is never closed": _fill_only("1,2,3\n", begin='t_s,"u_V,y_um\n'),
    "one line of digits": _fill_only("1"),
    "one line of numbers": _fill_only("1 2,3;", "\n"),
    "one line of letters": _fill_only("a"),
    "one name": _fill_only("time_", f",u_V,y_um\n{_SAMPLES}", "t"),
    "names of times": _fill_only("time_s,"),
    "columns": _widen(120),
    "columns of few digits": _widen(100),
    "names without samples": _fill_only("name,", "\n"),
    "names above short lines": _shorten,
    "blank lines": _fill("\n"),
    "blank lines first": _fill_only("\n", _HEAD + _SAMPLES),
    "only blank lines": _fill_only(" \n"),
    "carriage returns": _fill_only("\r", _HEAD + _SAMPLES),
    "comments": _fill_only("# 1,2\n", _HEAD + _SAMPLES),
    "description": _fill_only("Model,MDO3024,x\n", _HEAD + _SAMPLES),
    "long lines of text": _describe("a,"),
    "long lines of numbers": _describe("1,"),
    "long lines of almost numbers": _describe("1,1,1,1;"),
    "long lines of quotes": _describe('"",'),
    "one column": _fill_only("1\n", begin="y\n"),
    "short samples": _fill("1\n"),
    "small samples": _fill_only("1,2\n", begin="u,y\n"),
    "missing values": _fill_only(",,\n", begin=_HEAD + _SAMPLES),
    "words": _fill_only("a b\n"),
    "numbers with points and commas": _fill_only("1.5;1,5;1,500\n", begin="t_s;u_V;y_um\n"),
    "uncertain numbers": _fill_only("1,500;1,250\n", begin="u;y\n"),
    "unmarked bytes": _fill_only("\N{LATIN SMALL LETTER E WITH ACUTE},1\n", begin="u,y\n"),
    "zeros": _fill_only("\0"),
}


def reading_seconds(read: Callable[[Path], object], path: Path, repetitions: int = 1) -> float:
    """Return the least CPU time in seconds in which a file is read, or refused."""
    times = []
    # A collection visits all objects of the tests.
    gc.disable()
    try:
        for _ in range(repetitions):
            began = time.process_time()
            with suppress(IslandsError):
                read(path)
            times.append(time.process_time() - began)
    finally:
        gc.enable()
    return min(times)
