"""Options and settings of commands from a TOML file, such as ``islands.toml`` in the current folder."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from islands.errors import SettingsError, suggest

#: File that is read from the current folder if it exists.
DEFAULT_FILE = Path("islands.toml")


def read_option_tables(path: Path) -> dict[str, Any]:
    """Read a file with a table for each command.

    Raises
    ------
    SettingsError
        The file does not exist or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise SettingsError(f"--config {path}: there is no such file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is not TOML: {error}") from error


def match_options(command: Any, table: Any, path: Path, title: str) -> dict[str, Any]:
    """Return the values of a table by the parameters of a command, for ``default_map`` of its context.

    Parameters
    ----------
    command : Command or Group
        Command of the command line. The table of a group has a table for each of its commands.
    table : mapping
        Values by the names of options and settings: ``input``, ``max_terms``.
    path, title
        File and table in messages.

    Raises
    ------
    SettingsError
        The table has an entry that is neither an option nor a setting of the command.
    """
    from islands.cli.settings_options import GIVEN, list_names  # noqa: PLC0415 - pydantic

    if not isinstance(table, Mapping):
        raise SettingsError(f"{path}: write the options of a command as a table: [{title}]")
    commands = getattr(command, "commands", {})
    options = {} if commands else _list_options(command)
    settings = list_names(command)
    found: dict[str, Any] = {}
    for given, value in table.items():
        name = given.replace("-", "_")
        if given in commands:
            found[given] = match_options(commands[given], value, path, f"{title}.{given}")
        elif name in settings:
            items = [f"{key}={each}" for key, each in value.items()] if isinstance(value, dict) else value
            text = ",".join(map(str, items)) if isinstance(items, list) else items
            found.setdefault(GIVEN, []).append(f"{name}={text}")
        elif name in options:
            found[options[name].name] = _convert(options[name], value)
        else:
            raise SettingsError(
                f"{path}, [{title}]: there is no {given!r}{suggest(name, [*commands, *options, *settings])}"
                f"; islands {title.replace('.', ' ')} --help and islands settings list the names"
            )
    return found


def _list_options(command: Any) -> dict[str, Any]:
    """Return the parameters of a command by the names of its options."""
    return {
        option.removeprefix("--").replace("-", "_"): parameter
        for parameter in command.params
        for option in (*parameter.opts, *parameter.secondary_opts)
        if option.startswith("--")
    }


def _convert(parameter: Any, value: Any) -> Any:
    """Return a value as the command line would pass it: a repeatable option takes a list."""
    return [value] if parameter.multiple and not isinstance(value, list) else value
