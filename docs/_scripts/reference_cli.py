"""Generated reference of the command line, from the command tree of typer."""

import inspect
from collections.abc import Iterator
from typing import Any, get_args

from tables import code, codes, escape, page, section, table
from typer.main import get_command

from islands.cli.app import MEASUREMENTS
from islands.cli.settings_options import list_classes
from islands_api.cli.app import app


def commands() -> Iterator[tuple[str, Any]]:
    """Yield every command by its whole name, groups before their members."""
    yield from _walk("islands", get_command(app))


def _walk(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield name, command
    for inner in command.list_commands(None) if hasattr(command, "list_commands") else ():
        yield from _walk(f"{name} {inner}", command.get_command(None, inner))


def options(command: Any) -> list[Any]:
    """Return the options of a command that are shown in its help."""
    return [each for each in command.params if each.param_type_name == "option" and not each.hidden]


def settings() -> dict[type, list[str]]:
    """Return the classes of settings, with the commands that have them."""
    found: dict[type, list[str]] = {}
    for name, command in commands():
        for cls in list_classes(command):
            found.setdefault(cls, []).append(name)
    return found


def cli() -> str:
    """Return the page of the command line."""
    return page(
        "Command line",
        "Every command of `islands` with its arguments and options. `islands COMMAND --help` shows the same. "
        f"{codes(MEASUREMENTS)} need a checkout of the repository.",
        *(_command(name, command) for name, command in commands() if name != "islands"),
    )


def _command(name: str, command: Any) -> str:
    level = len(name.split())
    members = hasattr(command, "list_commands")
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    usage = [name, *(_usage(each) for each in arguments), "COMMAND" if members else "[OPTIONS]"]
    parts = [_help(command.help), f"```text\n{' '.join(usage)}\n```"]
    rows = [(code(each.name.upper()), escape(each.help or "")) for each in arguments]
    if rows:
        parts.append(table(("Argument", "Meaning"), rows))
    rows = [(_names(each), escape(_meaning(each)), _default(each)) for each in options(command)]
    if rows:
        parts.append(table(("Option", "Meaning", "Default"), rows))
    return section(f"`{name}`", *parts, level=level)


def _usage(argument: Any) -> str:
    text = argument.name.upper() + ("..." if argument.nargs == -1 else "")
    return text if argument.required else f"[{text}]"


def _names(option: Any) -> str:
    names = ", ".join([*option.opts, *option.secondary_opts])
    value = "" if option.is_flag else f" {_type(option)}"
    variables = f"<br>{code(option.envvar)}" if option.envvar else ""
    return code(names + value) + variables


def _type(option: Any) -> str:
    if option.metavar:
        return str(option.metavar)
    annotation = option.type_descriptor.annotation
    kind = (get_args(annotation) or (annotation,))[0]
    return {"str": "TEXT"}.get(kind.__name__, kind.__name__.upper())


def _meaning(option: Any) -> str:
    """Return the help of an option."""
    # The command line escapes brackets, which are markup there.
    return str(option.help.replace("\\[", "["))


def _default(option: Any) -> str:
    if option.required:
        return "required"
    return "" if option.default in (None, "", False, [], ()) else code(option.default)


def _help(text: str | None) -> str:
    return inspect.cleandoc(text or "").replace("``", "`").replace("\b\n", "")
