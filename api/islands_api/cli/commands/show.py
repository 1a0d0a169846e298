"""``islands show``: a model as text."""

from pathlib import Path
from typing import Annotated

import typer

from islands.io.export import EXPORTS, FILE_EXPORTS, export, write_export
from islands.io.export.extension import export_extended
from islands_api.cli import options


def show(
    model: options.ModelFile,
    kind: Annotated[str, typer.Option("--format", help=", ".join([*EXPORTS, *FILE_EXPORTS]))] = "plain",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File to write; required for fmu and fmu2, which are not text."),
    ] = None,
) -> None:
    """Show or write a model as an equation, a program, a block for a simulator, or JSON.

    Equations: plain text, LaTeX, MathML. Programs: Python, C, MATLAB. Blocks: FMU of
    FMI 3.0 and 2.0, Simulink S-function, MATLAB System, Modelica.
    """
    extended = options.extended(model)
    if extended is None and out is not None:
        write_export(options.model(model), kind, out)
        return
    text = export(options.model(model), kind) if extended is None else export_extended(extended, kind)
    if out is None:
        typer.echo(text.rstrip("\n"))
    else:
        out.write_text(f"{text.rstrip()}\n", encoding="utf-8")
