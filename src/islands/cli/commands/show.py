"""``islands show``: a model as text."""

from pathlib import Path
from typing import Annotated

import typer

from islands.cli import options
from islands.export import EXPORTS, FILE_EXPORTS
from islands.facade.load import load
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.identification import Result
from islands.io.result_text.text_layout import term_table, wrap
from islands.models.equations import named_signals


def show(
    model: options.ModelFile,
    kind: Annotated[
        str | None,
        typer.Option(
            "--format",
            help=f"{', '.join([*EXPORTS, *FILE_EXPORTS])}. By default one term in each line, with its "
            "standard error and the columns of the record.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File to write; required for fmu and fmu2, which are not text."),
    ] = None,
) -> None:
    """Show or write a model as an equation, a program, a block for a simulator, or JSON.

    Equations: plain text, LaTeX, MathML. Programs: Python, C, MATLAB. Blocks: FMU of
    FMI 3.0 and 2.0, Simulink S-function, MATLAB System, Modelica. An extended
    simulation is a program in C or MATLAB; one with a closed form is exported like a
    model, a model of several outputs as one program or block.
    """
    loaded = load(model)
    if kind is None and out is None and isinstance(loaded, Result | FittedModel):
        found = loaded.best.model if isinstance(loaded, Result) else loaded.model
        stated = named_signals(found)
        typer.echo("\n".join([*term_table(found), *(wrap(f"where {stated}") if stated else [])]))
        return
    text = loaded.export(kind or "plain", out)
    if text is not None:
        typer.echo(text.rstrip("\n"))
