"""Base classes of all deliberate errors. A message says what is wrong, where, and what to do."""

from collections.abc import Mapping
from typing import TypeVar

T = TypeVar("T")


class IslandsError(Exception):
    """Base class of all deliberate errors."""


class RecordError(IslandsError):
    """A record is invalid or unsuitable. The message names the row and column if known."""


class ModelError(IslandsError):
    """A model, an expression or a model file is invalid."""


class SettingsError(IslandsError):
    """A setting is unknown, out of range, or contradicts another setting."""


def lookup(table: Mapping[str, T], name: str, kind: str) -> T:
    """Return an entry of a table by name.

    Parameters
    ----------
    kind : str
        What the entries are, for the message.

    Raises
    ------
    SettingsError
        The name is unknown. The message lists the names of the table.
    """
    if name not in table:
        raise SettingsError(f"unknown {kind} {name!r}: take one of {', '.join(table)}")
    return table[name]
