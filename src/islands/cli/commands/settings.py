"""``islands settings``: what ``--set`` and the file of options can change."""

from collections.abc import Iterator
from typing import Annotated, Any

import typer

from islands.cli.console import output
from islands.cli.settings_options import list_classes
from islands.errors import SettingsError
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
    first, _, _ = command.partition(" ")
    users: dict[type, list[str]] = {}
    for name, each in _walk(context.parent.command, context.parent, only=first):
        if command in ("", name):
            for cls in list_classes(each):
                users.setdefault(cls, []).append(name)
    if not users:
        raise SettingsError(
            f"there is no command {command!r} with settings: islands --help lists the commands"
        )
    for cls, names in users.items():
        text = str(cls.__doc__).partition("\n\nAttributes")[0]
        output.print(f"{' '.join(text.split())} Of {', '.join(names)}.", markup=False)
        for name, info, values in list_settings(cls):
            default = "" if info.default_factory else _write(info.default)
            output.print(f"  {name}: {values}{default and f', by default {default}'}", markup=False)
            output.print("\n".join(wrap(f"      {info.description}", "      ")), markup=False)
        output.print()


def _walk(group: Any, context: Any, prefix: str = "", only: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the commands that have settings, by their names; import one of them only if it is given."""
    for name in group.list_commands(context):
        if only and name != only:
            continue
        command = group.get_command(context, name)
        if hasattr(command, "commands"):
            yield from _walk(command, context, f"{name} ")
        elif list_classes(command):
            yield prefix + name, command


def _write(default: object) -> str:
    """Return a default as a value of ``--set``."""
    match default:
        case None:
            return ""
        case dict():
            return ",".join(f"{name}={value}" for name, value in default.items())
        case tuple():
            return ",".join(map(str, default))
        case bool():
            return str(default).lower()
    return str(default)
