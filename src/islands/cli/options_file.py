"""Options of commands from a TOML file, such as ``islands.toml`` in the current folder."""

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
        Values by the names of the options without dashes: ``input``, ``max-terms``.
    path, title
        File and table in messages.

    Raises
    ------
    SettingsError
        The table has an entry that is no option of the command.
    """
    if not isinstance(table, Mapping):
        raise SettingsError(f"{path}: write the options of a command as a table: [{title}]")
    commands = getattr(command, "commands", None)
    if commands is not None:
        known: dict[str, Any] = dict(commands)
    else:
        known = {
            option.removeprefix("--"): parameter
            for parameter in command.params
            for option in (*parameter.opts, *parameter.secondary_opts)
            if option.startswith("--")
        }
    if unknown := [name for name in table if name not in known]:
        raise SettingsError(
            f"{path}, [{title}]: there is no option {unknown[0]!r}; it has {', '.join(sorted(known))}"
            f"{suggest(unknown[0], known)}"
        )
    if commands is not None:
        return {
            name: match_options(known[name], value, path, f"{title}.{name}") for name, value in table.items()
        }
    return {known[name].name: _convert(known[name], value) for name, value in table.items()}


def _convert(parameter: Any, value: Any) -> Any:
    """Return a value as the command line would pass it: a repeatable option takes a list."""
    return [value] if parameter.multiple and not isinstance(value, list) else value
