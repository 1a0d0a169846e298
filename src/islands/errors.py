"""Every deliberate error of the house. The message says what is wrong, where, and what to do."""

from collections.abc import Mapping
from typing import TypeVar

T = TypeVar("T")


class IslandsError(Exception):
    """Base of all deliberate errors: catch this to catch them all."""


class RecordError(IslandsError):
    """A record cannot be used as it is: the message names row and column and says what to do."""


class ModelError(IslandsError):
    """A model, an expression or a model file is not what it should be."""


class SettingsError(IslandsError):
    """A setting is out of its range, unknown, or contradicts another one."""


def lookup(table: Mapping[str, T], name: str, kind: str) -> T:
    """Return an entry of a table by name.

    Raises
    ------
    SettingsError
        There is none of that name: the message lists what there is.
    """
    if name not in table:
        raise SettingsError(f"unknown {kind} {name!r}: take one of {', '.join(table)}")
    return table[name]
