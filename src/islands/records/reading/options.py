"""Options of reading a record, for what a file leaves open: names, table, number format, dates, sampling."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any
from zoneinfo import ZoneInfo

from pydantic import BeforeValidator

from islands.errors import SettingsError, name_option, name_without_value
from islands.records.reading.column_names import TIME_UNITS
from islands.settings_schema import list_changes, setting, settings_class

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


def split_words(words: Sequence[str]) -> tuple[str, ...]:
    """Return words without blanks around them; a single text has commas between them."""
    listed = words.split(",") if isinstance(words, str) else words
    return tuple(str(word).strip() for word in listed)


#: Words; a single text has commas between them.
_Words = Annotated[tuple[str, ...], BeforeValidator(split_words)]


@settings_class
class ReadingOptions:
    """Options of reading a file."""

    names: _Words = setting((), "Names of the columns of a table without a header, or instead of its header.")
    header: bool = setting(
        True,
        "Whether a text table or a sheet has a header. Without one, and without `names`, the columns are c1, "
        "c2, ...",
    )
    time: str | None = setting(None, "Time column, if its name does not tell.")
    time_unit: str | None = setting(
        None,
        "Unit of the numbers of the time column; by default that of its name, or of a known count such as "
        "the days of Excel.",
        choices=TIME_UNIT_CHOICES,
    )
    sheet: str | None = setting(
        None,
        "Sheet of a workbook, or group of an HDF5, MDF or TDMS file; by default the first with a table.",
    )
    decimal: str | None = setting(None, "Decimal mark; by default inferred.", choices=DECIMAL_MARKS)
    dates: str | None = setting(
        None,
        "Order of day and month in dates such as 3/4/2026; by default inferred from all dates of a column.",
        choices=DATE_ORDERS,
    )
    timezone: str | None = setting(None, "Time zone of time stamps without an offset, as Europe/Berlin.")
    resample: float | None = setting(None, "Sampling time to which the record is resampled.", gt=0, unit="s")
    missing: _Words = setting(
        (),
        "Words and numbers in cells that mean a missing value, as Failed,-9999. Words such as OL and #DIV/0! "
        "are known.",
    )
    gaps: str | None = setting(
        None,
        "What becomes of gaps and missing values. `split` makes a segment of each part between them, "
        "`interpolate` fills them.",
        choices=GAPS,
    )
    outliers: str = setting(
        EXCLUDE,
        "What becomes of gross errors of the output: isolated spikes, codes such as -9999, a stuck sensor. "
        "`exclude` treats them as missing values, `keep` uses them.",
        choices=(EXCLUDE, KEEP),
    )
    rates: str | None = setting(
        None,
        "How columns of different sampling times are read. By default the record has the samples of the "
        "slowest column, and an input with more samples is the `mean` from each of them to the next, or, if "
        "it predicts the output much better, the `sample` at each of them. `rows` takes every row as a "
        "sample of every column.",
        choices=RATES,
    )

    def __post_init__(self) -> None:
        if not all(self.names) or len(set(self.names)) < len(self.names):
            raise SettingsError(f"{name_option('names', list(self.names))}: give every column another name")
        if not all(self.missing):
            raise SettingsError(
                f"{name_without_value('missing')}: a word is empty; empty cells are missing values without it"
            )
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
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in list_changes(self).items()
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
    return ReadingOptions(**reading)


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
