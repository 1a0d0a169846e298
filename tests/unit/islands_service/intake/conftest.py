"""Fork servers whose processes run a given program instead of a reader."""

import sys

import pytest

from islands_service.intake.reader_process import ForkServer

#: Replaces the programs of a fork server.
SERVER = """
import sys
from islands_service.intake import fork_server
program = compile(sys.argv[1], "program", "exec")
fork_server.PROGRAMS = dict.fromkeys((*fork_server.PROGRAMS, "simulation_preview"), lambda: exec(program, {}))
fork_server.main()
"""


@pytest.fixture
def programs():
    """Return a function that returns a fork server whose processes run a program."""
    started = []

    def start(program):
        started.append(ForkServer((sys.executable, "-P", "-c", SERVER, program)))
        return started[-1]

    yield start
    for server in started:
        server.close()
