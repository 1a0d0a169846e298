"""Processes that compile, store and load kernels, each test with its cache folder."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from support.forks import Fork

Start = Callable[..., "subprocess.Popen[str] | Fork"]


@contextmanager
def process_starter(folder: Path, begin: Callable[..., "subprocess.Popen[str] | Fork"]) -> Iterator[Start]:
    """Yield a function that starts a process in a folder; processes still running at the end are killed."""
    running = []

    def start(code: str, *arguments: str, **variables: str) -> "subprocess.Popen[str] | Fork":
        environment = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
        environment |= {"PYTHONPATH": str(folder), "ISLANDS_CACHE_DIR": str(folder / "cache")} | variables
        running.append(begin(code, arguments, environment, folder))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


def start_interpreter(code: str, arguments: Sequence[str], variables: dict[str, str], folder: Path):
    command, pipe = [sys.executable, "-W", "error", "-c", code, *arguments], subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=variables, stdout=pipe, stderr=pipe, text=True)


def get_output(process):
    """Return the JSON output of a process, which must have succeeded with an empty stderr."""
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert not errors
    return json.loads(out)


def wait_for_file(path: Path, process) -> None:
    """Wait for a file that a process writes."""
    while not path.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)
