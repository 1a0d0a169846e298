"""A confined process reads only its file and the installed software, and does nothing else to the machine."""

import subprocess
import sys

import pytest

#: Tries an action after the confinement and prints whether it is refused. Only `given` is readable.
SCRIPT = """
import os, socket, sys, threading
from pathlib import Path
given, other, action = sys.argv[1:]
from islands_service.intake.confinement import confine
confine([Path(given)])

def fork():
    if os.fork() == 0:
        os._exit(0)

def load_libraries():
    import h5py, numpy, openpyxl, pyarrow.parquet, nptdms, zoneinfo
    zoneinfo.ZoneInfo("Europe/Berlin")

actions = {
    "read the file": lambda: open(given).read(),
    "list a folder of the software": lambda: os.listdir(os.path.dirname(os.__file__)),
    "start a thread": lambda: threading.Thread(target=print).start(),
    "load libraries": load_libraries,
    "read another file": lambda: open(other).read(),
    "list another folder": lambda: os.listdir(os.path.dirname(other)),
    "read the environment of the parent": lambda: open(f"/proc/{os.getppid()}/environ").read(),
    "write the file": lambda: open(given, "r+"),
    "make a file": lambda: open(other + "x", "w"),
    "delete a file": lambda: os.remove(other),
    "make a folder": lambda: os.mkdir(other + "y"),
    "open a socket": lambda: socket.socket(),
    "open a local socket": lambda: socket.socket(socket.AF_UNIX),
    "start a process": lambda: os.execv("/bin/true", ["true"]),
    "fork": fork,
    "signal the parent": lambda: os.kill(os.getppid(), 0),
    "limit the parent": lambda: __import__("resource").prlimit(os.getppid(), 7),
}
try:
    actions[action]()
except OSError as error:
    print("refused", error.errno)
else:
    print("done")
"""

ALLOWED = ("read the file", "list a folder of the software", "start a thread", "load libraries")
REFUSED = (
    *("read another file", "list another folder", "read the environment of the parent", "write the file"),
    *("make a file", "delete a file", "make a folder", "open a socket", "open a local socket"),
    *("start a process", "fork", "signal the parent", "limit the parent"),
)


@pytest.mark.ci
@pytest.mark.parametrize("action", [*ALLOWED, *REFUSED])
def test_a_confined_process_can_only_read(tmp_path, action):
    given, other = tmp_path / "given.csv", tmp_path / "other" / "other.csv"
    other.parent.mkdir()
    for path in (given, other):
        path.write_text("0")
    command = [sys.executable, "-P", "-c", SCRIPT, given, other, action]
    found = subprocess.run(command, capture_output=True, text=True, check=True)
    words = found.stdout.split()
    assert words[-1:] == ["done"] if action in ALLOWED else words[0] == "refused", found
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["given.csv", "other", "other.csv"]
