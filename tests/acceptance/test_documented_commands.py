"""Commands and options that the documentation names exist."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from typer.main import get_command

from islands_api.cli.app import app
from support import pages
from support.pages import PAGES, page_name
from support.repository import ROOT


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


@pytest.mark.parametrize("page", ["README.md", "docs/how-to/choose-a-preset.md"])
def test_the_stated_defaults_are_those_of_the_commands(page: str) -> None:
    text = (ROOT / page).read_text("utf-8")
    stated = re.findall(r"`(\w+) (--[\w-]+) (\w+)`(?= and [^.]*the defaults?\b|,? the defaults?\b)", text)
    assert {command for command, _, _ in stated} == {"fit", "identify"}
    for name, option, value in stated:
        command, _ = find_command(["islands", name])
        (parameter,) = [each for each in command.params if option in each.opts]
        assert value in (parameter.default, parameter.show_default), (name, option)


class ScriptCommand(NamedTuple):
    """Command that runs a script or tests of the repository."""

    program: str
    path: Path
    words: list[str]


def script_commands(page: Path) -> Iterator[ScriptCommand]:
    """Yield the commands of a page that run a script or tests of the repository."""
    code = [code for _, code in pages.blocks(page)] + re.findall(r"`([^`\n]+)`", pages.prose(page))
    for line in "\n".join(code).splitlines():
        if re.match(r"python -m lab\.|(python|pytest) .*\b(deploy|tests)/\S+\.py", line.strip()):
            program, *words = shlex.split(line.split(" #")[0])
            if words[0] == "-m" and program == "python":
                words = [f"{words[1].replace('.', '/')}.py", *words[2:]]
            path = next(word for word in words if word.endswith(".py"))
            yield ScriptCommand(program, ROOT / path, [word for word in words if word != path])


def check_script_command(command: ScriptCommand) -> None:
    """Check that a script has the measurements and options of a command, and that a test has its marks."""
    source = command.path.read_text("utf-8")
    if command.program == "pytest":
        marks = set(command.words) - {"-m"}
        assert all(f"pytest.mark.{mark}" in source for mark in marks), command
        return
    for module in re.findall(r"^from (lab[\w.]+) import", source, re.MULTILINE):
        own = ROOT / f"{module.replace('.', '/')}.py"
        source += own.read_text("utf-8") if own.exists() else ""
    for number, word in enumerate(command.words):
        name = word.partition("=")[0]
        if name.startswith("--"):
            field = name[2:].replace("-", "_")
            options = (f'"{name}"', f"    {field}: float = _option(", "parse_known_args")
            assert any(option in source for option in options), command
        elif number == 0 or not command.words[number - 1].startswith("--"):
            assert f'"{word}": ' in source, command


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_scripts_and_tests_that_a_page_runs_exist(page: Path) -> None:
    for command in script_commands(page):
        check_script_command(command)


def test_the_figures_of_operation_have_commands() -> None:
    page = ROOT / "docs/how-to/operate-the-service.md"
    rows = [line.split("|")[1:-1] for line in page.read_text("utf-8").splitlines() if line.startswith("| ")]
    speed = [row for row in rows if len(row) == 4 and row[0].strip() != "figure"]
    assert len(speed) > 25
    assert all("`" in row[-1] or row[-1].strip() == "the same" for row in speed)
    assert len(list(script_commands(page))) > 15
