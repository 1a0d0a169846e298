"""Commands whose reader closes the pipe exit quietly, and unknown commands suggest similar ones."""

import os
import subprocess
import sys

import pytest

from islands_api.cli.app import COMMANDS
from support.command_line import islands


@pytest.mark.ci
@pytest.mark.parametrize(
    ("arguments", "code"),
    [(("--version",), 1), (("systems", "list"), 141), (("examples", "list"), 141), (("--help",), 1)],
)
def test_command_with_a_closed_output_exits_quietly(arguments: tuple[str, ...], code: int) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        program = "from islands_api.cli import main; main()"
        found = subprocess.run(
            [sys.executable, "-c", program, *arguments], stdout=closed, stderr=subprocess.PIPE, check=False
        )
    assert (found.stderr, found.returncode) == (b"", code)


@pytest.mark.parametrize("name", COMMANDS)
def test_mistyped_command_suggests_the_command(name: str) -> None:
    found = islands(name + name[-1])
    assert found.exit_code == 2
    assert f"Did you mean '{name}'" in " ".join(found.output.split())
