"""Settings on the command line: options of daily work, ``--set``, and their precedence."""

from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

from islands.cli.settings_options import Given, with_settings
from islands.errors import SettingsError
from islands.evolution.settings import Settings
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.settings_schema import list_changes


def run(*words: str, file: dict[str, Any] | None = None) -> dict[str, Any]:
    """Run a command that has nothing but settings; return those that it receives, by class."""
    found: dict[str, Any] = {}

    @with_settings
    def command(search: Annotated[Given, Settings], steps: PreprocessingSteps) -> None:
        found.update(search=dict(search), steps=list_changes(steps))

    app = typer.Typer(add_completion=False)
    app.command()(command)
    result = CliRunner().invoke(app, words, catch_exceptions=False, default_map=file)
    assert result.exit_code == 0, result.output
    return found


def test_a_command_without_settings_receives_none() -> None:
    assert run() == {"search": {}, "steps": {}}


def test_given_settings_are_the_only_changes_and_reach_their_class() -> None:
    words = ("--generations", "7", "--set", "target_error=0.5", "--set", "decimate=4")
    assert run(*words) == {"search": {"generations": 7, "target_error": 0.5}, "steps": {"decimate": 4}}


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("crossover=0.5", "crossover", 0.5),
        ("shifts=1,3", "shifts", (1, 3)),
        ("prune-copies=false", "prune_copies", False),
        ("primitives=mul,phi1", "primitives", ("mul", "phi1")),
        ("migrate_every=5,9:2", "migrate_every", "5,9:2"),
        ("constraints=odd; gain = 2.5", "constraints", "odd; gain = 2.5"),
        ("estimator=", "estimator", ""),
    ],
)
def test_a_text_becomes_a_value_of_the_setting(text: str, name: str, value: object) -> None:
    assert run("--set", text)["search"] == {name: value}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "popultion=3",
            "--set popultion: not one of those that islands settings lists. Did you mean 'population'?",
        ),
        ("population", "--set population: write NAME=VALUE"),
        ("population=0", "population is an integer of at least 1, got '0'"),
        ("shifts=0", "shifts is a list of integers of at least 1, got '0'"),
        ("select=luck", "select is one of validation, fitness, got 'luck'"),
    ],
)
def test_an_invalid_setting_is_refused(text: str, message: str) -> None:
    with pytest.raises(SettingsError) as error:
        run("--set", text)
    assert message in str(error.value)


def test_the_command_line_precedes_a_file_and_set_precedes_an_option() -> None:
    file = {"given_settings": ["generations=3", "population=30"]}
    assert run(file=file)["search"] == {"generations": 3, "population": 30}
    assert run("--generations", "4", file=file)["search"] == {"generations": 4, "population": 30}
    found = run("--generations", "4", "--set", "elite=0.5", file=file)["search"]
    assert found == {"generations": 4, "population": 30, "elite": 0.5}
    assert run("--generations", "4", "--set", "generations=5")["search"] == {"generations": 5}
