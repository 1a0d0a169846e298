"""Options of preprocessing, for the commands that search models, generated from `PreprocessingSteps`."""

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any

import typer

from islands.data.preprocessing_steps import DETREND, PreprocessingSteps
from islands.errors import SettingsError

#: Types and descriptions of the options, by the field.
_OPTIONS: dict[str, tuple[Any, str]] = {
    "lowpass": (float | None, "Cutoff in Hz of a zero-phase low-pass filter of inputs and output."),
    "decimate": (int | None, "Keep one of this number of samples, behind a low-pass filter."),
    "detrend": (str | None, f"{', '.join(DETREND)}: subtract the means; linear also a line from the output."),
}


def with_preprocessing_options(command: Callable[..., None]) -> Callable[..., None]:
    """Replace the parameter ``steps`` of a command by the options of preprocessing.

    The command receives their values as one `PreprocessingSteps`.
    """
    names = [field.name for field in fields(PreprocessingSteps)]
    options = [_parameter(name) for name in names]

    @wraps(command)
    def run(**given: Any) -> None:
        values = {name: given.pop(name) for name in names}
        command(
            steps=PreprocessingSteps(**{name: value for name, value in values.items() if value is not None}),
            **given,
        )

    declared = signature(command)
    parameters = [
        parameter
        for each in declared.parameters.values()
        for parameter in (options if each.name == "steps" else [each])
    ]
    run.__signature__ = declared.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run


def check_one_output(steps: PreprocessingSteps, outputs: int) -> None:
    """Check that a model of several outputs has no preprocessing.

    Raises
    ------
    SettingsError
        It has.
    """
    if outputs > 1 and not steps.is_none:
        raise SettingsError("--lowpass, --decimate and --detrend are for one output: leave them out")


def _parameter(name: str) -> Parameter:
    kind, text = _OPTIONS[name]
    annotation: Any = Annotated[kind, typer.Option(f"--{name}", help=text)]
    return Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=None, annotation=annotation)
