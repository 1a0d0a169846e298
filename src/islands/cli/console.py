"""Consoles: results go to standard output, progress and errors to standard error."""

import os
import sys
from typing import NoReturn

from rich.console import Console

#: Exit code of a program whose reader has closed the pipe: 128 and the number of SIGPIPE.
CLOSED_OUTPUT = 141


def exit_with_closed_output() -> NoReturn:
    """Exit quietly because the reader of the output has ended, as that of ``islands show result | head``."""
    # Python writes the rest of its buffer at exit, which would fail again.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(CLOSED_OUTPUT)


output = Console(highlight=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


def print_message(message: str, _fraction: float | None = None, /) -> None:
    """Print a progress message to the standard error stream."""
    errors.print(message, markup=False)
