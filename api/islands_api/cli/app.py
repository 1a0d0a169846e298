"""The table of commands, and what becomes of an error: one line that says what to do, exit code 2."""

import os
import sys
from importlib import import_module
from typing import Any

import typer
from rich.markup import escape
from typer.core import TyperGroup

from islands.errors import IslandsError
from islands_api.cli.console import errors

#: What tells libraries of linear algebra how many threads to take.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

#: Every command is a file of its own with a function, or a group of commands, of the command's name.
COMMANDS = (
    *("identify", "fit", "diagnose", "simulate", "show", "demo"),
    *("bench", "trials", "systems", "serve", "jobs", "keys"),
)


class Commands(TyperGroup):
    """Imports a command when it is called for: one that asks a service about its jobs needs no kernels."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; report an error in one line and exit with 2, or 130 where it was interrupted."""
        try:
            return super().invoke(ctx)
        except (IslandsError, OSError) as error:
            errors.print(f"[bold red]error:[/] {escape(str(error))}", highlight=False)
            sys.exit(2)
        except KeyboardInterrupt:
            errors.print("stopped")
            sys.exit(130)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Return the names in the table's order."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Return a command, or None where there is none of that name."""
        if cmd_name not in COMMANDS:
            return None
        found = getattr(import_module(f"islands_api.cli.commands.{cmd_name}"), cmd_name)
        if not isinstance(found, typer.Typer):
            alone = typer.Typer(pretty_exceptions_enable=False)
            alone.command(name=cmd_name)(found)
            found = alone
        command = typer.main.get_command(found)
        command.name = cmd_name
        return command


app = typer.Typer(
    cls=Commands,
    help="Find the equation behind measured data.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.callback()
def _islands() -> None:
    pass


def main() -> None:
    """Run the command line."""
    # Matrices are small here, and islands, trials and other jobs have the cores: threads of linear algebra
    # would wait for each other, and sums depend on how many they are. NumPy is not imported yet.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    app()
