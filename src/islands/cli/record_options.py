"""Options of reading a record, for every command that reads one, generated from `ReadingOptions`."""

from collections.abc import Callable
from dataclasses import Field, fields
from inspect import Parameter
from typing import Annotated, Any

import typer

from islands.cli.option_groups import group_options, make_option
from islands.errors import name_flag
from islands.records.reading.options import ReadingOptions

#: Prefix of the parameters, which keeps them apart from those of a search.
_PREFIX = "reading_"

#: Types of options that are not an optional text.
_TYPES: dict[str, Any] = {"resample": float | None}

#: Options of several words, with commas between them.
_LISTS = frozenset({"names", "missing"})


def _make_option(option: Field[Any]) -> Parameter:
    if option.name == "header":
        annotation: Any = Annotated[
            bool, typer.Option(name_flag(option.name, False), help=option.metadata["help"])
        ]
        default = False
    else:
        kind = _TYPES.get(option.name, str | None)
        annotation = Annotated[kind, typer.Option(name_flag(option.name), help=option.metadata["help"])]
        default = None
    return make_option(_PREFIX + option.name, annotation, default)


def with_reading_options(command: Callable[..., None]) -> Callable[..., None]:
    """Replace the parameter ``reading`` of a command by the options of reading a record.

    The command receives their values as one `ReadingOptions`.
    """
    return group_options(
        command, "reading", [_make_option(option) for option in fields(ReadingOptions)], _collect
    )


def _collect(values: dict[str, Any]) -> ReadingOptions:
    changes = {name.removeprefix(_PREFIX): value for name, value in values.items() if value is not None}
    changes["header"] = not changes["header"]
    for name in _LISTS.intersection(changes):
        changes[name] = tuple(changes[name].split(","))
    return ReadingOptions(**changes)
