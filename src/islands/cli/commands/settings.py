"""``islands settings``: what ``--set`` and the file of options can change."""

from collections.abc import Iterator
from typing import Annotated, Any

import typer

from islands.cli.console import output
from islands.cli.settings_options import list_classes
from islands.errors import SettingsError, suggest
from islands.report.text.layout import wrap
from islands.settings_schema import list_settings


def settings(
    context: typer.Context,
    command: Annotated[
        str, typer.Argument(help="A command, such as fit; all commands by default.", show_default=False)
    ] = "",
) -> None:
    """List the settings of commands: name, default, values, meaning.

    Change them by --set NAME=VALUE, or in islands.toml: a table for each command, as [fit].
    """
    assert context.parent is not None
    commands = dict(_walk(context.parent.command, context.parent))
    if command and command not in commands:
        raise SettingsError(f"{command!r} is no command with settings{suggest(command, commands)}")
    users: dict[type, list[str]] = {}
    for name, each in commands.items():
        if command in ("", name):
            for cls in list_classes(each):
                users.setdefault(cls, []).append(name)
    for cls, names in users.items():
        title = str(cls.__doc__).partition("\n")[0]
        output.print(f"[bold]{title}[/] Of {', '.join(names)}.", markup=True)
        for name, info, values in list_settings(cls):
            output.print(f"  {name} = {_write(info.default)}: {values}", markup=False)
            output.print("\n".join(wrap(f"      {info.description}", "      ")), markup=False)
        output.print()


def _walk(group: Any, context: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the commands that have settings, by their names."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if hasattr(command, "commands"):
            yield from _walk(command, context, f"{name} ")
        elif list_classes(command):
            yield prefix + name, command


def _write(default: object) -> str:
    """Return a default as a value of ``--set``."""
    match default:
        case None | "" | ():
            return ""
        case tuple():
            return ",".join(map(str, default))
        case bool():
            return str(default).lower()
    return str(default)
