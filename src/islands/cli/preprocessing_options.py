"""Options of preprocessing, for the commands that search models, generated from `PreprocessingSteps`."""

from collections.abc import Callable
from dataclasses import fields
from inspect import Parameter
from typing import Annotated, Any

import typer

from islands.cli.option_groups import group_options, make_option
from islands.records.preprocessing_steps import DETREND, PreprocessingSteps

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
    return group_options(
        command, "steps", [_make_option(each.name) for each in fields(PreprocessingSteps)], _collect
    )


def _collect(values: dict[str, Any]) -> PreprocessingSteps:
    return PreprocessingSteps(**{name: value for name, value in values.items() if value is not None})


def _make_option(name: str) -> Parameter:
    kind, text = _OPTIONS[name]
    return make_option(name, Annotated[kind, typer.Option(f"--{name}", help=text)])
