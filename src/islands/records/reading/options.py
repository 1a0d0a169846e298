"""Options of reading a record, for what a file leaves open: names, table, number format, dates, sampling."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any
from zoneinfo import ZoneInfo

from islands.errors import SettingsError, check_seconds, name_option, name_without_value, suggest
from islands.records.reading.column_names import TIME_UNITS

#: Characters of the decimal marks by the values of ``decimal``.
DECIMAL_MARKS = {"point": ".", "comma": ","}

#: Values of ``dates``: the order of day and month in dates such as 3/4/2026.
DATE_ORDERS = ("day-first", "month-first")

#: Values of ``time_unit``.
TIME_UNIT_CHOICES = tuple(unit for unit in TIME_UNITS if unit)

#: Values of ``gaps``.
GAPS = ("split", "interpolate")

#: Values of ``outliers``.
EXCLUDE, KEEP = "exclude", "keep"
#: Values of ``rates``: how an input with more samples than the slowest column is read, or that every row is a
#: sample of every column.
MEAN, SAMPLE, ROWS = RATES = ("mean", "sample", "rows")


def _option(help_text: str, default: Any = None) -> Any:
    return field(default=default, metadata={"help": help_text})


@dataclass(frozen=True, slots=True)
class ReadingOptions:
    """Options of reading a file. The options of the command line are generated from the fields.

    Attributes
    ----------
    names : tuple of str
        Names of the columns of a table without a header, or instead of its header.
    header : bool
        Whether a text table or a sheet has a header. Without one, and without ``names``, the columns are c1,
        c2, ...
    time : str, optional
        The time column; by default it is found by its name.
    time_unit : str, optional
        Unit of the numbers of the time column, ``s``, ``ms``, ``us``, ``ns``, ``min``, ``h`` or ``d``; by
        default that of its name, or of a known count such as the days of Excel.
    sheet : str, optional
        Sheet of a workbook, or group of an HDF5, MDF or TDMS file; by default the first with a table.
    decimal : str, optional
        ``point`` or ``comma``; by default inferred.
    dates : str, optional
        ``day-first`` or ``month-first``; by default inferred from all dates of a column.
    timezone : str, optional
        Time zone of time stamps without an offset, such as ``Europe/Berlin``.
    resample : float, optional
        Sampling time in seconds to which the record is resampled.
    missing : tuple of str
        Words and numbers in cells that mean a missing value, in addition to the words that are known, such as
        ``OL`` and ``#DIV/0!``.
    gaps : str, optional
        ``split`` makes a segment of each part between gaps, ``interpolate`` fills them.
    outliers : str
        ``exclude`` treats gross errors of the output as missing values, ``keep`` uses them.
    rates : str, optional
        How columns of different sampling times are read. By default the record has the samples of the slowest
        column, and an input with more samples is the ``mean`` from each of them to the next, or, if it
        predicts the output much better, the ``sample`` at each of them. ``rows`` takes every row as a
        sample of every column.

    Raises
    ------
    SettingsError
        A value is invalid.
    """

    names: tuple[str, ...] = _option("Names of the columns of a table without header, as a,b,c.", ())
    header: bool = _option("The table has no header: its columns are c1, c2, ...", True)
    time: str | None = _option("Time column, if its name does not tell.")
    time_unit: str | None = _option(
        "Unit of the time column: s, ms, us, ns, min, h or d; by default inferred."
    )
    sheet: str | None = _option("Sheet of a workbook, or group of a file; by default the first with a table.")
    decimal: str | None = _option("Decimal mark: point or comma; by default inferred.")
    dates: str | None = _option("Order in dates such as 3/4/2026: day-first or month-first.")
    timezone: str | None = _option("Time zone of time stamps without offset, as Europe/Berlin.")
    resample: float | None = _option("Resample to this sampling time in seconds.")
    missing: tuple[str, ...] = _option(
        "Words and numbers that mean a missing value, as Failed,-9999; OL, #DIV/0! and others are known.", ()
    )
    gaps: str | None = _option("Gaps and missing values: split into segments, or interpolate.")
    outliers: str = _option(
        "Gross errors of the output (isolated spikes, codes such as -9999, a stuck sensor): exclude or keep.",
        EXCLUDE,
    )
    rates: str | None = _option("Columns of different rates: mean or sample of the faster inputs, or rows.")

    def __post_init__(self) -> None:
        names = split_words(self.names)
        if not all(names) or len(set(names)) < len(names):
            raise SettingsError(f"{name_option('names', list(names))}: give every column another name")
        object.__setattr__(self, "names", names)
        words = split_words(self.missing)
        if not all(words):
            raise SettingsError(
                f"{name_without_value('missing')}: a word is empty; empty cells are missing values without it"
            )
        object.__setattr__(self, "missing", words)
        _check_choice("time_unit", self.time_unit, TIME_UNIT_CHOICES)
        _check_choice("decimal", self.decimal, DECIMAL_MARKS)
        _check_choice("dates", self.dates, DATE_ORDERS)
        _check_choice("gaps", self.gaps, GAPS)
        _check_choice("outliers", self.outliers, (EXCLUDE, KEEP))
        _check_choice("rates", self.rates, RATES)
        if self.resample is not None:
            check_seconds(self.resample, name_without_value("resample"))
        _check_timezone(self.timezone)

    @property
    def has_header(self) -> bool:
        """Whether the names are in the file."""
        return self.header and not self.names

    @property
    def decimal_mark(self) -> str | None:
        """The decimal mark as a character, None if it is inferred."""
        return None if self.decimal is None else DECIMAL_MARKS[self.decimal]

    def check_array_file(self, file: str, sheets: bool = False, zones: bool = True) -> None:
        """Refuse options of tables for a file of arrays, whose names and numbers are certain.

        Parameters
        ----------
        file : str
        sheets, zones : bool
            Whether the file may have sheets, and times without a time zone.

        Raises
        ------
        SettingsError
            An option does not apply.
        """
        given = {
            name_without_value("names"): self.names,
            name_option("header", False): not self.header,
            name_without_value("decimal"): self.decimal,
            name_without_value("dates"): self.dates,
            name_without_value("sheet"): None if sheets else self.sheet,
            name_without_value("timezone"): None if zones else self.timezone,
        }
        for option, value in given.items():
            if value:
                raise SettingsError(f"{file} is not a table of text: leave {option} out")

    def changes(self) -> Mapping[str, Any]:
        """Return the options that differ from the default, as JSON values."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in given.items()
            if value != getattr(DEFAULT_READING, name)
        }


def take_reading(reading: object) -> ReadingOptions:
    """Return options of reading that are given as such, or as a mapping of their names to values.

    Raises
    ------
    SettingsError
        An option is unknown or invalid.
    """
    if isinstance(reading, ReadingOptions):
        return reading
    if not isinstance(reading, Mapping):
        raise SettingsError(
            f'reading is a mapping of options, such as {{"gaps": "split"}}, got a {type(reading).__name__}'
        )
    known = [option.name for option in fields(ReadingOptions)]
    for name in reading:
        if name not in known:
            raise SettingsError(
                f"a record is read without an option {name}: take one of {', '.join(known)}"
                f"{suggest(str(name), known)}"
            )
    return ReadingOptions(**reading)


def split_words(words: Sequence[str]) -> tuple[str, ...]:
    """Return words without blanks around them; a single text has commas between them."""
    listed = words.split(",") if isinstance(words, str) else words
    return tuple(str(word).strip() for word in listed)


def _check_choice(option: str, value: str | None, choices: Sequence[str] | Mapping[str, str]) -> None:
    if value is not None and value not in choices:
        raise SettingsError(
            f"{name_without_value(option)} is {' or '.join(choices)}, got {value!r}{suggest(value, choices)}"
        )


def _check_timezone(name: str | None) -> None:
    try:
        if name is not None:
            ZoneInfo(name)
    except (OSError, ValueError, LookupError) as error:
        raise SettingsError(
            f"{name_option('timezone', name)} is not a time zone of this machine: give a name such "
            "as Europe/Berlin or UTC"
        ) from error


#: Options of a file that is read without further information.
DEFAULT_READING = ReadingOptions()
