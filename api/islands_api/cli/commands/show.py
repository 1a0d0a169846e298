"""``islands show``: a model as text."""

from pathlib import Path
from typing import Annotated

import typer

from islands.io.export import EXPORTS, FILE_EXPORTS, export, write_export
from islands.io.export.closed_form import closed_form
from islands.io.export.extension import export_extended
from islands.io.result_text.text_layout import term_table, wrap
from islands.model.equations import named_signals
from islands_api.cli import options
from islands_api.cli.runs.coupled_run import read_coupled


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
    coupled, extended = read_coupled(model), options.extended(model)
    if kind is None and out is None and coupled is None and extended is None:
        found = options.model(model)
        stated = named_signals(found)
        typer.echo("\n".join([*term_table(found), *(wrap(f"where {stated}") if stated else [])]))
        return
    kind = kind or "plain"
    if extended is not None and kind not in FILE_EXPORTS:
        text = export_extended(extended, kind)
    else:
        chosen = coupled or (closed_form(extended) if extended is not None else options.model(model))
        if out is not None:
            write_export(chosen, kind, out)
            return
        text = export(chosen, kind)
    if out is None:
        typer.echo(text.rstrip("\n"))
    else:
        out.write_text(f"{text.rstrip()}\n", encoding="utf-8")
