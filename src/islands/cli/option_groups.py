"""Options of a command that it receives as one value."""

from collections.abc import Callable, Sequence
from functools import wraps
from inspect import Parameter, signature
from typing import Any


def make_option(name: str, annotation: Any, default: Any = None) -> Parameter:
    """Return a parameter of a command, which its annotation declares as an option."""
    return Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default, annotation=annotation)


def group_options(
    command: Callable[..., None],
    name: str,
    options: Sequence[Parameter],
    collect: Callable[[dict[str, Any]], Any],
) -> Callable[..., None]:
    """Replace a parameter of a command by options, whose values the command receives as one value.

    Parameters
    ----------
    command : callable
    name : str
        The parameter that is replaced.
    options : sequence of Parameter
        Options in the order of the help.
    collect : callable
        Returns the value of the parameter from the values of the options by name.
    """

    @wraps(command)
    def run(**given: Any) -> None:
        values = {option.name: given.pop(option.name) for option in options}
        command(**{name: collect(values)}, **given)

    declared = signature(command)
    parameters = [
        parameter
        for each in declared.parameters.values()
        for parameter in (options if each.name == name else [each])
    ]
    run.__signature__ = declared.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run
