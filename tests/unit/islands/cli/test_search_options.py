"""Options of a search: generated from the fields of `Settings`."""

import typer
from typer.testing import CliRunner

from islands.cli.search_options import DEFAULTS, SearchOptions, with_search_options


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


def test_command_without_options_receives_the_defaults() -> None:
    assert run() == SearchOptions("auto", 0, {})


def test_given_options_are_the_only_changes() -> None:
    found = run("--seed", "7", "--preset", "narx", "--target-error", "0.5", "--select", "fitness")
    assert found == SearchOptions("narx", 7, {"select": "fitness", "target_error": 0.5})


def test_every_switch_of_the_search_is_one_option() -> None:
    words = (
        *(
            "--crossover",
            "0.5",
            "--mutation",
            "0.4",
            "--elite",
            "0.2",
            "--prune",
            "0.3",
            "--tolerance",
            "1e-4",
        ),
        *("--shifts", "1", "--shifts", "3", "--tournament", "2", "--overlong", "parent"),
        *("--no-prune-copies", "--distinct", "--no-niches", "--err-target", "increment"),
    )
    assert run(*words).changes == {
        "crossover": 0.5,
        "mutation": 0.4,
        "elite": 0.2,
        "prune": 0.3,
        "tolerance": 1e-4,
        "shifts": [1, 3],
        "tournament": 2,
        "overlong": "parent",
        "prune_copies": False,
        "distinct": True,
        "niches": False,
        "err_target": "increment",
    }


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
