"""Commands and options that the documentation names exist."""

import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from islands_api.cli.app import app
from support import pages
from support.pages import PAGES, page_name


@cache
def command_tree() -> Any:
    return get_command(app)


def find_command(words: list[str]) -> tuple[Any, list[str]]:
    """Return the command that words call, and the words behind its name."""
    command, rest = command_tree(), words[1:]
    while rest and hasattr(command, "list_commands"):
        inner = command.get_command(None, rest[0])
        assert inner is not None, f"no command {rest[0]!r}"
        command, rest = inner, rest[1:]
    return command, rest


def option_names(command: Any) -> set[str]:
    return {"--help", *(name for each in command.params for name in (*each.opts, *each.secondary_opts))}


def used_options(words: list[str]) -> Iterator[str]:
    for word in words:
        name = word.strip("[]().,").partition("=")[0]
        if name.startswith("--"):
            yield name


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_commands_and_options_of_a_page_exist(page: Path) -> None:
    for line in pages.commands(page):
        if line.startswith("islands "):
            words = shlex.split(line.replace("...", ""))
            command, rest = find_command(words)
            unknown = set(used_options(rest)) - option_names(command)
            assert not unknown, line


def test_a_wrong_option_is_found() -> None:
    command, rest = find_command(shlex.split("islands jobs submit piezo.csv --input u_V --outputs y_um"))
    assert set(used_options(rest)) - option_names(command) == {"--outputs"}


def test_a_wrong_command_is_found() -> None:
    with pytest.raises(AssertionError, match="no command"):
        find_command(["islands", "jobs", "begin"])
