"""``islands show``: a model as text."""

from typing import Annotated

import typer

from islands.io.export import EXPORTS, export
from islands_api.cli import options


def show(
    model: Annotated[str, typer.Argument(help="A model file, or published:12, published:13, published:14.")],
    kind: Annotated[str, typer.Option("--format", help=", ".join(EXPORTS))] = "plain",
) -> None:
    """Show a model as an equation (plain text, LaTeX, MathML), a program (Python, C, MATLAB) or JSON."""
    typer.echo(export(options.model(model), kind).rstrip("\n"))
