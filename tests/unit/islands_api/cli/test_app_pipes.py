"""Commands whose reader closes the pipe exit quietly, and unknown commands suggest similar ones."""

import os
import subprocess

import pytest

from islands_api.cli.app import COMMANDS
from islands_api.cli.console import CLOSED_OUTPUT
from support.command_line import ISLANDS, islands


@pytest.mark.ci
@pytest.mark.parametrize(
    ("arguments", "is_joined"),
    [
        *((each, False) for each in ("", "fit --help", "systems list")),
        *((each, True) for each in ("--help", "show no-result")),
        *(
            pytest.param(*each, marks=pytest.mark.nightly)
            for each in [
                *((each, False) for each in ("--help", "--version", "jobs --help")),
                *((each, True) for each in ("systems list", "fitt")),
            ]
        ),
    ],
)
def test_command_with_a_closed_output_exits_quietly(arguments: str, is_joined: bool) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        errors = closed if is_joined else subprocess.PIPE
        found = subprocess.run([ISLANDS, *arguments.split()], stdout=closed, stderr=errors, check=False)
    assert (found.stderr or b"", found.returncode) == (b"", CLOSED_OUTPUT)


@pytest.mark.ci
def test_head_receives_its_lines_from_a_shell() -> None:
    shell = f"set -o pipefail; {ISLANDS} --help | head -n 2"
    found = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, check=False)
    assert (found.stderr, "Usage: islands" in found.stdout) == ("", True)
    # All of the help may be in the pipe before its reader ends.
    assert found.returncode in (0, CLOSED_OUTPUT)


@pytest.mark.parametrize("name", COMMANDS)
def test_mistyped_command_suggests_the_command(name: str) -> None:
    found = islands(name + name[-1])
    assert found.exit_code == 2
    assert f"Did you mean '{name}'" in " ".join(found.output.split())
