"""Options of reading a record, for every command that reads one, generated from `ReadingOptions`."""

from collections.abc import Callable
from dataclasses import Field, fields
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any

import typer

from islands.io.records.reading_options import DEFAULT_READING, ReadingOptions

#: Prefix of the parameters, which keeps them apart from those of a search.
_PREFIX = "reading_"

#: Types of options that are not an optional text.
_TYPES: dict[str, Any] = {"resample": float | None}


def _parameter(option: Field[Any]) -> Parameter:
    if option.name == "header":
        annotation: Any = Annotated[bool, typer.Option("--no-header", help=option.metadata["help"])]
        default = False
    else:
        kind = _TYPES.get(option.name, str | None)
        annotation = Annotated[kind, typer.Option(f"--{option.name}", help=option.metadata["help"])]
        default = None
    return Parameter(
        _PREFIX + option.name, Parameter.POSITIONAL_OR_KEYWORD, default=default, annotation=annotation
    )


def with_reading_options(command: Callable[..., None]) -> Callable[..., None]:
    """Replace the parameter ``reading`` of a command by the options of reading a record.

    The command receives their values as one `ReadingOptions`.
    """
    options = [_parameter(option) for option in fields(ReadingOptions)]

    @wraps(command)
    def run(**given: Any) -> None:
        values = {option.name: given.pop(_PREFIX + option.name) for option in fields(ReadingOptions)}
        changes = {name: value for name, value in values.items() if value is not None}
        changes["header"] = not changes["header"]
        if "names" in changes:
            changes["names"] = tuple(changes["names"].split(","))
        command(reading=ReadingOptions(**changes) if changes else DEFAULT_READING, **given)

    declared = signature(command)
    parameters = [
        parameter
        for each in declared.parameters.values()
        for parameter in (options if each.name == "reading" else [each])
    ]
    run.__signature__ = declared.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run
