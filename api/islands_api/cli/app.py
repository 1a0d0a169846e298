"""Table of commands, and error handling: one line on standard error and exit code 2."""

import os
import sys
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperGroup

from islands.errors import IslandsError
from islands_api.cli.console import errors

#: Environment variables that set the number of threads of linear algebra libraries.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

#: Commands, in the order of the help. Each is a file with a function or a group of the command's name.
COMMANDS = (
    *("identify", "fit", "diagnose", "simulate", "show", "demo"),
    *("bench", "trials", "systems", "serve", "jobs", "keys"),
)


class Commands(TyperGroup):
    """Group that imports a command on demand, so that ``islands jobs`` does not load the kernels."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command. Report an error in one line and exit with code 2, or 130 if interrupted."""
        try:
            return super().invoke(ctx)
        except (IslandsError, OSError) as error:
            errors.print(f"[bold red]error:[/] {escape(str(error))}", highlight=False)
            sys.exit(2)
        except KeyboardInterrupt:
            errors.print("stopped")
            sys.exit(130)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Return the names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Return a command, or None if no command has the name."""
        if cmd_name not in COMMANDS:
            return None
        group = getattr(import_module(f"islands_api.cli.commands.{cmd_name}"), cmd_name)
        if not isinstance(group, typer.Typer):
            function, group = group, typer.Typer(pretty_exceptions_enable=False)
            group.command(name=cmd_name)(function)
        command = typer.main.get_command(group)
        command.name = cmd_name
        return command


app = typer.Typer(
    cls=Commands,
    help="Find the equation behind measured data.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"islands {version('islands')}")
        raise typer.Exit


@app.callback()
def _islands(
    _: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line."""
    # The matrices are small, and the cores are busy with islands and jobs: more threads would wait for each
    # other, and the sums would depend on their number. Must be set before NumPy is imported.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    app()
