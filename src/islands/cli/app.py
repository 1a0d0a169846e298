"""Application of commands: their table, and error handling, one line on standard error and exit code 2."""

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

import typer
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup

from islands.cli.console import errors, exit_with_closed_output
from islands.cli.laboratory import import_laboratory
from islands.cli.options_file import DEFAULT_FILE, match_options, read_option_tables
from islands.cli.stop_requests import exit_code, ignore_signals, raise_on_signals
from islands.distribution import describe_missing_extra, read_version
from islands.errors import (
    IslandsError,
    SettingsError,
    command_line_names,
    suggest,
)
from islands.processes import limit_threads


class Command(NamedTuple):
    """Command of a table.

    Attributes
    ----------
    package : str
        Package with a module of the command's name, which has a function or a group of this name.
    description : str
        Description in the help, which imports no command.
    """

    package: str
    description: str


def make_commands(package: str, descriptions: Mapping[str, str]) -> Mapping[str, Command]:
    """Return the table of the commands of a package."""
    return MappingProxyType({name: Command(package, text) for name, text in descriptions.items()})


#: Commands that need no service, in the order of the help.
COMMANDS = make_commands(
    "islands.cli.commands",
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
        "simulate": "Simulate a model on records. A free run needs only the inputs.",
        "show": "Show or write a model as an equation, a program, a block for a simulator, JSON, or a "
        "report.",
        "settings": "List the settings that --set changes: name, default, values, meaning.",
        "examples": "Records to try the commands on, and of simulated systems: list them, write them.",
        "demo": "Identify the record of the paper's case 1 and compare the models with those of the paper.",
    },
)

#: Commands of a checkout, which measure the project; ``lab`` has them.
MEASUREMENTS = make_commands(
    "lab.commands",
    {
        "reproduce": "Compute the tables and figures of the paper, and write them next to the published "
        "numbers.",
        "benchmark": "Published sets of measurements: list them, run the searches or other packages on them.",
        "bench": "Measure evaluations, kernels and whole searches on this machine, which should be otherwise "
        "idle.",
        "trials": "Inject effects into simulated records, diagnose them, and count how often they are found "
        "and named.",
    },
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
    """Group that imports a command on demand, so that ``islands jobs`` does not load the kernels."""

    #: Commands by name, in the order of the help.
    table: Mapping[str, Command] = MappingProxyType({**COMMANDS, **MEASUREMENTS})
    _is_listing = False

    def invoke(self, ctx: Any) -> Any:
        """Run the command. Report an error in one line; exit with code 2, or 130 or 143 after a signal."""
        try:
            try:
                with command_line_names(_RareNames()):
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
        if args[0] not in self.table and (similar := suggest(args[0], self.table)):
            ctx.fail(f"No such command {args[0]!r}{similar}")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Return the names in the order of the table."""
        return list(self.table)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Return a command, or None if no command has the name.

        Raises
        ------
        SettingsError
            The packages of the command are not installed, or there is no checkout.
        """
        if cmd_name not in self.table:
            return None
        package, description = self.table[cmd_name]
        if self._is_listing:
            panel = "Measurements of the project, in a checkout" if cmd_name in MEASUREMENTS else None
            return TyperCommand(cmd_name, help=description, rich_help_panel=panel)
        name = f"{package}.{cmd_name}"
        try:
            if cmd_name in MEASUREMENTS:
                module = import_laboratory(name, f"islands {cmd_name}")
            else:
                module = import_module(name)
        except ModuleNotFoundError as error:
            raise explain_missing_package(error, cmd_name) from error
        group = getattr(module, cmd_name)
        if not isinstance(group, typer.Typer):
            function, group = group, typer.Typer(pretty_exceptions_enable=False, add_completion=False)
            group.command(name=cmd_name)(function)
        command = typer.main.get_command(group)
        command.name = cmd_name
        command.help = command.help or description
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


class _RareNames:
    """Names of the settings of searches and files that no option gives.

    Their classes are imported when a message needs a name.
    """

    def __contains__(self, name: object) -> bool:
        from islands.evolution.settings import Settings  # noqa: PLC0415
        from islands.facade.fit_settings import FitSettings  # noqa: PLC0415
        from islands.records.preprocessing_steps import PreprocessingSteps  # noqa: PLC0415
        from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
        from islands.settings_schema import is_daily, list_settings  # noqa: PLC0415

        classes = (Settings, FitSettings, ReadingOptions, PreprocessingSteps)
        found = [is_daily(info) for cls in classes for each, info, _ in list_settings(cls) if each == name]
        return bool(found) and not any(found)


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
