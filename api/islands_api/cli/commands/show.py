"""``islands show``: a model as text."""

from typing import Annotated

import typer

from islands.io.export import EXPORTS, export
from islands.io.export.extension import export_extended
from islands_api.cli import options


def show(
    model: options.ModelFile,
    kind: Annotated[str, typer.Option("--format", help=", ".join(EXPORTS))] = "plain",
) -> None:
    """Show a model as an equation (plain text, LaTeX, MathML), a program (Python, C, MATLAB) or JSON."""
    extended = options.extended(model)
    text = export(options.model(model), kind) if extended is None else export_extended(extended, kind)
    typer.echo(text.rstrip("\n"))
