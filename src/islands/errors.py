"""Base classes of all deliberate errors. A message says what is wrong, where, and what to do."""

import shlex
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite, nan
from numbers import Integral, Real
from reprlib import repr as abbreviate
from typing import TypeVar, cast

T = TypeVar("T")

#: Number of characters of an unknown name that are compared: a request may contain a name of a megabyte.
_MAX_COMPARED = 200


class AdvisedText(str):
    """Text that names options which its reader may give.

    The text is a `str` in every other respect. Operations of `str`, such as formatting, return texts without
    the options: `join_text` keeps them.

    Attributes
    ----------
    options : tuple of (str, object)
        Name and value of each option, in the order of the text. The value is None if only the reader knows
        it.
    """

    __slots__ = ("options",)

    options: tuple[tuple[str, object], ...]

    def __new__(cls, text: str, options: Iterable[tuple[str, object]] = ()) -> "AdvisedText":
        """Make a text with options."""
        found = super().__new__(cls, text)
        found.options = tuple(dict.fromkeys(options))
        return found


def join_text(*parts: str) -> AdvisedText:
    """Join texts to one that names all options of its parts."""
    return AdvisedText("".join(parts), (option for part in parts for option in get_options(part)))


def get_options(text: str) -> tuple[tuple[str, object], ...]:
    """Return the options that a text names; none for a text without advice."""
    return text.options if isinstance(text, AdvisedText) else ()


class IslandsError(Exception):
    """Base class of all deliberate errors."""

    @property
    def message(self) -> str:
        """The message, with the options that it names; ``str(error)`` has none."""
        given = self.args[0] if self.args else ""
        return given if isinstance(given, str) else str(given)


class RecordError(IslandsError):
    """A record is invalid or unsuitable. The message names the row and column if known."""


class ModelError(IslandsError):
    """A model, an expression or a model file is invalid."""


class SettingsError(IslandsError):
    """A setting is unknown, out of range, or contradicts another setting."""


class EngineError(IslandsError):
    """What runs a computation on several cores or machines does not start, or cannot go on."""


class ExtrapolationWarning(UserWarning):
    """An input of the validation data leaves the range of the estimation data."""


@contextmanager
def command_line_names(settings: Container[str] = ()) -> Iterator[None]:
    """Let messages name options as on the command line, in this process.

    Parameters
    ----------
    settings : container of str
        Names that no option but ``--set`` gives.
    """

    def name(option: str, value: object) -> str:
        if option not in settings:
            return name_flag(option, value)
        return f"--set {option}=" if value is None else f"--set {shlex.quote(write_setting(option, value))}"

    _names.append(name)
    try:
        yield
    finally:
        _names.pop()


def name_option(name: str, value: object = None, example: object = None) -> AdvisedText:
    """Return an option as the caller gives it: ``dt=0.1``, or ``--dt 0.1`` on the command line.

    Parameters
    ----------
    name : str
        Name of the argument of the library.
    value : object
        Its value. Without one, only the option is named.
    example : object
        Value that is written in its place if only the reader knows the value; in capital letters it is a
        placeholder.

    Returns
    -------
    AdvisedText
        With the option and its value, rounded as it is written.
    """
    written = _names[-1](name, value if example is None else example)
    rounded = float(_format(value)) if isinstance(value, float) else value
    # Lists, such as names of columns, are examples.
    return AdvisedText(written, [(name, None if isinstance(value, list) else rounded)])


def name_without_value(name: str) -> str:
    """Return an option as the subject of a sentence: ``dt``, or ``--dt`` on the command line."""
    return name_option(name).removesuffix("=")


def _name_argument(name: str, value: object) -> str:
    is_literal = isinstance(value, str) and not value.isupper()
    return f"{name}=" + (f'"{value}"' if is_literal else _format(value))


def _format(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def name_flag(name: str, value: object = None) -> str:
    """Return an option of the command line: ``--dt 0.1``."""
    flag = f"--{name.replace('_', '-')}"
    return flag if value is None else f"{flag} {shlex.quote(_format(value))}"


def write_setting(name: str, value: object) -> str:
    """Return a setting as a value of ``--set``: ``gaps=split``."""
    text = ",".join(map(str, value)) if isinstance(value, list | tuple) else _format(value)
    return f"{name}={text.lower() if isinstance(value, bool) else text}"


#: Functions that name an option; the last one is used.
_names: list[Callable[[str, object], str]] = [_name_argument]


def suggest(name: str, known: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: which known names are similar.

    Returns
    -------
    str
        ``. Did you mean 'narx'?`` with up to three names, the most similar first; empty if none is similar.
    """
    names = {each.lower(): each for each in known}
    close = get_close_matches(str(name)[:_MAX_COMPARED].lower(), names)
    return f". Did you mean {', '.join(repr(names[each]) for each in close)}?" if close else ""


def lookup(table: Mapping[str, T], name: str, kind: str) -> T:
    """Return an entry of a table by name.

    Parameters
    ----------
    kind : str
        What the entries are, for the message.

    Raises
    ------
    SettingsError
        The name is unknown. The message lists the names of the table, and suggests similar ones.
    """
    if name not in table:
        known = f"take one of {', '.join(table)}" if table else "there is none"
        raise SettingsError(f"unknown {kind} {name!r}: {known}{suggest(name, table)}")
    return table[name]


def check_seconds(value: object, name: str, kind: type[IslandsError] = SettingsError) -> float:
    """Return a time in seconds, after a check that it is a positive number.

    Raises
    ------
    IslandsError
        It is not. The message has the name of the argument; ``kind`` is the class of the error.
    """
    try:
        seconds = float(value) if isinstance(value, Real) and not isinstance(value, bool) else nan
    except TypeError:  # a timedelta64 of NumPy is an Integral
        seconds = nan
    if not (isfinite(seconds) and seconds > 0):
        raise kind(f"{name} must be a positive number of seconds, got {abbreviate(value)}")
    return seconds


def check_integers(**values: object) -> None:
    """Check that settings, which are given by name, are integers or None.

    Raises
    ------
    SettingsError
        A value is not.
    """
    for name, value in values.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, Integral)):
            raise SettingsError(f"{name} is an integer, got {abbreviate(value)}")


def check_sequences(**values: object) -> None:
    """Check that settings, which are given by name, are sequences and not texts.

    Raises
    ------
    SettingsError
        A value is not.
    """
    for name, value in values.items():
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise SettingsError(f"{name} is a sequence, such as [{value!r}], got {abbreviate(value)}")


def check_callables(**values: object) -> None:
    """Check that arguments, which are given by name, can be called.

    Raises
    ------
    SettingsError
        A value cannot.
    """
    for name, value in values.items():
        if not callable(value):
            raise SettingsError(f"{name} is a function, got {abbreviate(value)}")


def check_seed(seed: object) -> None:
    """Check that a seed is an integer and not negative.

    Raises
    ------
    SettingsError
        It is not.
    """
    if seed is None:
        raise SettingsError("seed is an integer, got None: results are reproducible")
    check_integers(seed=seed)
    if cast("int", seed) < 0:
        raise SettingsError(f"a seed is not negative, got {seed}")


def check_type(value: object, kind: type, user: str, advice: str) -> None:
    """Check the class of an argument.

    Parameters
    ----------
    user : str
        Function that takes the argument.
    advice : str
        What to do, for the message.

    Raises
    ------
    SettingsError
        It is of another class.
    """
    if not isinstance(value, kind):
        raise SettingsError(f"{user} takes a {kind.__name__}, got a {type(value).__name__}: {advice}")


def check_numbers(**values: object) -> None:
    """Check that settings, which are given by name, are numbers.

    Raises
    ------
    SettingsError
        A value is not.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, Real):
            raise SettingsError(f"{name} is a number, got {abbreviate(value)}")
