"""Ends of commands: a closed pipe, a late signal; and unknown commands suggest similar ones."""

import os
import signal
import subprocess
import sys

import pytest

from islands.cli.console import CLOSED_OUTPUT
from support.command_line import ISLANDS


@pytest.mark.ci
@pytest.mark.parametrize(
    ("arguments", "is_joined"),
    [
        *((each, False) for each in ("", "examples")),
        ("show no-result", True),
        *(
            pytest.param(*each, marks=pytest.mark.nightly)
            for each in [
                *((each, False) for each in ("--help", "--version", "fit --help", "jobs --help")),
                *((each, True) for each in ("--help", "examples", "fitt")),
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


def test_a_signal_after_the_end_of_a_command_does_not_change_its_exit_code() -> None:
    """Ctrl-C killed a command whose result was complete while Python ended."""
    code = (
        "import atexit, sys, time; from islands_api.cli.app import main; "
        "atexit.register(lambda: (print('ending', flush=True), time.sleep(0.2))); "
        "sys.argv = ['islands', '--version']; main()"
    )
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], text=True, **pipes) as process:
        assert process.stdout is not None
        assert [process.stdout.readline().split()[0] for _ in range(2)] == ["islands", "ending"]
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=10)
    assert (err, process.returncode) == ("", 0)
