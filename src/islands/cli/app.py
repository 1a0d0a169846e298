"""Application of commands: their table, and error handling, one line on standard error and exit code 2."""

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup

from islands.cli.console import errors, exit_with_closed_output
from islands.cli.options_file import DEFAULT_FILE, match_options, read_option_tables
from islands.cli.stop_requests import exit_code, ignore_signals, raise_on_signals
from islands.distribution import describe_missing_extra, read_version
from islands.errors import IslandsError, SettingsError, suggest
from islands.processes.settings import limit_threads

#: Commands that need no service, and their descriptions, in the order of the help. Each is a file of
#: `islands.cli.commands` with a function or a group of the command's name. The help shows these descriptions,
#: so that it does not import the commands.
COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "inspect": "Describe a record: columns, sampling, dead time, noise, excitation, and the next "
        "command.",
        "identify": "Identify recordings of a system by evolution. Ctrl-C keeps the best so far; --resume "
        "DIR continues.",
        "fit": "Fit small models to recordings of a system by subset selection and least squares, and assess "
        "them.",
        "diagnose": "Find the errors of a simulation on recordings, name their causes, measure the gain of "
        "correction.",
        "monitor": "Follow a simulation over the records of a folder, and raise an alarm when an effect has "
        "changed.",
        "simulate": "Simulate a model on a record. A free run needs only the first samples of the output.",
        "show": "Show or write a model as an equation, a program, a block for a simulator, or JSON.",
        "examples": "Records to try the commands on: list them, copy them.",
        "demo": "Identify the record of the paper's case 1 and compare the models with those of the paper.",
        "reproduce": "Compute the tables and figures of the paper, and write them next to the published "
        "numbers.",
        "bench": "Measure evaluations, kernels and whole searches on this machine, which should be otherwise "
        "idle.",
        "trials": "Inject effects into simulated records, diagnose them, and count how often they are found "
        "and named.",
        "systems": "Simulated systems: list them, make records of them.",
    }
)

#: Extra of ``pyproject.toml`` by the package that it installs.
EXTRAS: Mapping[str, str] = MappingProxyType(
    {
        "ray": "ray",
        **dict.fromkeys(
            ("alembic", "fastapi", "httptools", "prometheus_client", "pydantic_settings"), "service"
        ),
        **dict.fromkeys(("python_multipart", "sqlalchemy", "starlette", "structlog", "uvicorn"), "service"),
    }
)


class Commands(TyperGroup):
    """Group that imports a command on demand, so that ``islands jobs`` does not load the kernels.

    Attributes
    ----------
    packages : mapping
        Commands and their descriptions by the package that contains their files.
    """

    packages: Mapping[str, Mapping[str, str]] = MappingProxyType({"islands.cli.commands": COMMANDS})
    _is_listing = False

    @property
    def descriptions(self) -> dict[str, str]:
        """Descriptions of all commands, in the order of the help."""
        return {name: text for commands in self.packages.values() for name, text in commands.items()}

    def invoke(self, ctx: Any) -> Any:
        """Run the command. Report an error in one line; exit with code 2, or 130 or 143 after a signal."""
        try:
            try:
                return super().invoke(ctx)
            except ModuleNotFoundError as error:
                raise explain_missing_package(error, str(ctx.invoked_subcommand)) from error
        except BrokenPipeError:
            exit_with_closed_output()
        except (IslandsError, OSError) as error:
            errors.print(f"[bold red]error:[/] {escape(str(error))}", highlight=False)
            sys.exit(2)
        except KeyboardInterrupt as interrupt:
            errors.print("stopped")
            sys.exit(exit_code(interrupt))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the arguments; for an unknown name, an error suggests similar ones."""
        known = self.descriptions
        if args[0] not in known and (similar := suggest(args[0], known)):
            ctx.fail(f"No such command {args[0]!r}{similar}")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Return the names in the order of the table."""
        return list(self.descriptions)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Return a command, or None if no command has the name.

        Raises
        ------
        SettingsError
            The packages of the command are not installed.
        """
        package = next((each for each, commands in self.packages.items() if cmd_name in commands), None)
        if package is None:
            return None
        if self._is_listing:
            return TyperCommand(cmd_name, help=self.packages[package][cmd_name])
        try:
            module = import_module(f"{package}.{cmd_name}")
        except ModuleNotFoundError as error:
            raise explain_missing_package(error, cmd_name) from error
        group = getattr(module, cmd_name)
        if not isinstance(group, typer.Typer):
            function, group = group, typer.Typer(pretty_exceptions_enable=False, add_completion=False)
            group.command(name=cmd_name)(function)
        command = typer.main.get_command(group)
        command.name = cmd_name
        for each in getattr(command, "commands", {cmd_name: command}).values():
            for parameter in each.params:
                # Statements such as [u(k-1)] >= 0 are not markup.
                parameter.help = escape(parameter.help or "")
        return command

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help from the table, without importing the commands."""
        self._is_listing = True
        try:
            super().format_help(ctx, formatter)
        finally:
            self._is_listing = False


def explain_missing_package(error: ModuleNotFoundError, command: str) -> Exception:
    """Return an error that names the extra with a missing package; the same error if no extra has it."""
    extra = EXTRAS.get((error.name or "").partition(".")[0])
    if extra is None:
        return error
    return SettingsError(describe_missing_extra(f"islands {command}", extra))


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"islands {read_version()}")
        raise typer.Exit


def _islands(
    context: typer.Context,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", help=f"TOML file with options, a table for each command; by default {DEFAULT_FILE}."
        ),
    ] = None,
    _: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    name = context.invoked_subcommand
    path = config or DEFAULT_FILE
    if name is None or (config is None and not path.is_file()):
        return
    table = read_option_tables(path).get(name, {})
    if table:
        assert isinstance(context.command, TyperGroup)
        command = context.command.get_command(context, name)
        context.default_map = {name: match_options(command, table, path, name)}
        errors.print(f"options of {path}: {', '.join(table)}", markup=False)


def make_app(commands: type[Commands] = Commands) -> typer.Typer:
    """Return the application with the commands of a group."""
    app = typer.Typer(
        cls=commands,
        help="Find the equation behind measured data.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )
    app.callback()(_islands)
    return app


def run(app: typer.Typer) -> None:
    """Run an application with the arguments of this process."""
    limit_threads()
    try:
        try:
            with raise_on_signals():
                try:
                    app()
                finally:
                    sys.stdout.flush()
        finally:
            ignore_signals()
    except BrokenPipeError:
        exit_with_closed_output()
    except SystemExit as end:
        # Rich and Click end with code 1 if they cannot write.
        if isinstance(end.__context__, BrokenPipeError):
            exit_with_closed_output()
        raise
