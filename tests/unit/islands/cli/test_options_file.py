"""Options from a file: those of the command line win, and an unknown name is refused."""

import json
from pathlib import Path

import pytest

from islands.cli.options_file import match_options, read_option_tables
from islands.errors import SettingsError
from islands_api.cli.app import AllCommands
from support.command_line import COLUMNS, succeed, write_hysteresis
from support.undrawn import undrawn_figures

FILE = Path("islands.toml")


@pytest.fixture(scope="module")
def group():
    return AllCommands(name="islands")


def match(group, command, table):
    return match_options(group.get_command(None, command), table, FILE, command)


def test_options_are_matched_to_parameters_by_name(group):
    found = match(
        group, "fit", {"input": "u_V", "output": "y_um", "max-terms": 3, "header": False, "delays": [1, 2]}
    )
    settings = ["max_terms=3", "header=False", "delays=1,2"]
    assert found == {"inputs": ["u_V"], "output_columns": ["y_um"], "given_settings": settings}


def test_the_table_of_a_group_has_tables_of_its_commands(group):
    found = match(group, "jobs", {"submit": {"priority": 3, "watch": True}})
    assert found == {"submit": {"given_settings": ["priority=3"], "watch": True}}


@pytest.mark.parametrize(
    ("command", "table", "message"),
    [
        (
            "fit",
            {"max-term": 3},
            r"\[fit\]: there is no 'max-term'. Did you mean 'max_terms'",
        ),
        ("jobs", {"send": {}}, r"\[jobs\]: there is no 'send'; islands jobs --help"),
        ("jobs", {"submit": 3}, r"write the options of a command as a table: \[jobs.submit\]"),
    ],
)
def test_an_unknown_name_is_refused(group, command, table, message):
    with pytest.raises(SettingsError, match=message):
        match(group, command, table)


@pytest.mark.parametrize(("content", "message"), [(None, "there is no such file"), ("a = ", "is not TOML")])
def test_an_unreadable_file_is_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "o.toml").write_text(content)
    with pytest.raises(SettingsError, match=message):
        read_option_tables(tmp_path / "o.toml")


@pytest.mark.ci
def test_options_of_the_command_line_win(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_hysteresis(tmp_path / "r.csv")
    lines = ["[fit]", 'library = "polynomial"', "max-terms = 2", "degree = 1", "lags = 1", 'out = "o"']
    FILE.write_text("\n".join(lines))
    with undrawn_figures():
        succeed("fit", "r.csv", *COLUMNS, "--max-terms", "1")
    settings = json.loads(Path("o/result.json").read_text())["settings"]
    assert (settings["library"], settings["max_terms"], settings["degree"]) == ("polynomial", 1, 1)


def test_every_option_has_help(group):
    """Options of one command, or of the commands of a group."""
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        for each in getattr(command, "commands", {name: command}).values():
            bare = [parameter.name for parameter in each.params if not getattr(parameter, "help", "")]
            assert not bare, (each.name, bare)
