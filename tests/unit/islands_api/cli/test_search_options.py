"""Options of a search: generated from the fields of `Settings`."""

from typing import Any

import typer
from typer.testing import CliRunner

from islands_api.cli.search_options import DEFAULTS, SETTINGS, SearchOptions, with_search_options


def run(*words: str) -> SearchOptions:
    """Run a command that has nothing but the options of a search; return their values."""
    found: list[SearchOptions] = []

    @with_search_options
    def command(search: SearchOptions = DEFAULTS) -> None:
        found.append(search)

    app = typer.Typer(add_completion=False)
    app.command()(command)
    result = CliRunner().invoke(app, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return found[0]


def parameters() -> dict[str, Any]:
    """Return the parameters of such a command, by name."""

    @with_search_options
    def command(search: SearchOptions = DEFAULTS) -> None:
        pass

    app = typer.Typer(add_completion=False)
    app.command()(command)
    return {each.name: each for each in typer.main.get_command(app).params}


def test_command_without_options_receives_the_defaults() -> None:
    assert run() == SearchOptions("auto", 0, {})


def test_given_options_are_the_only_changes() -> None:
    found = run("--seed", "7", "--preset", "narx", "--max-terms", "6", "--target-error", "0.5")
    assert found == SearchOptions("narx", 7, {"max_terms": 6, "target_error": 0.5})


def test_options_lie_between_preset_and_seed_in_declared_order() -> None:
    names = list(parameters())
    assert names == ["preset", *SETTINGS, "seed"]
    assert names[names.index("max_height") + 1] == "shooting"


def test_tuples_are_repeatable_and_unions_are_text() -> None:
    found = run(
        "--primitive", "mul", "--primitive", "phi1", "--character", "plain", "--migrate-every", "5,9:2"
    )
    assert found.changes == {
        "primitives": ["mul", "phi1"],
        "characters": ["plain"],
        "migrate_every": "5,9:2",
    }
    assert run("--migrants", "2").changes == {"migrants": "2"}
