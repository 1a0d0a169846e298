"""The table of commands, and what becomes of an error: one line that says what to do, exit code 2."""

import sys

import typer
from rich.markup import escape

from islands.errors import IslandsError
from islands_api.cli.bench import bench
from islands_api.cli.console import errors
from islands_api.cli.demo import demo
from islands_api.cli.fit import fit
from islands_api.cli.identify import identify
from islands_api.cli.show import show
from islands_api.cli.simulate import simulate
from islands_api.cli.systems import systems

app = typer.Typer(
    help="Find the equation behind measured data.", no_args_is_help=True, pretty_exceptions_enable=False
)
for command in (identify, fit, simulate, show, demo, bench):
    app.command()(command)
app.add_typer(systems, name="systems")


def main() -> None:
    """Run the command line."""
    try:
        app()
    except (IslandsError, OSError) as error:
        errors.print(f"[bold red]error:[/] {escape(str(error))}", highlight=False)
        sys.exit(2)
    except KeyboardInterrupt:
        errors.print("stopped")
        sys.exit(130)
