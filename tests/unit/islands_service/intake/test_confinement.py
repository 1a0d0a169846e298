"""A confined process reads what its user can read, and makes the system calls of the list alone."""

import json
import os
import platform
import subprocess
import sys

import pytest

from islands_service.intake import confinement

pytestmark = pytest.mark.ci

#: Confines itself, then prints the content of a file of root, its user, and its capabilities.
SCRIPT = """
import json, os, sys
from pathlib import Path
import zoneinfo
from islands_service.intake.confinement import confine
gaps = confine([Path(sys.argv[1])])
import h5py, numpy, openpyxl, pyarrow.parquet, nptdms
zoneinfo.ZoneInfo("Europe/Berlin")
os.listdir(os.path.dirname(os.__file__))
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps([gaps, open(sys.argv[1]).read(), [os.getuid(), os.geteuid()], int(status["CapPrm"], 16)]))
"""

CALLS = {**confinement._CALLS, **confinement._PREPARATION}

#: Confines itself, and makes every call that is not in the list. Prints those that are not refused.
CALLER = """
import ctypes, errno, json, sys
from islands_service.intake import confinement
listed = set(json.loads(sys.argv[1]))
libc = ctypes.CDLL(None, use_errno=True)
libc.prctl(38, 1, 0, 0, 0)
confinement.restrict_calls()
reached = []
for number in (*range(1000), *(0x40000000 + each for each in range(600))):
    if number not in listed and not (
        libc.syscall(number, 0, 0, 0, 0, 0, 0) == -1 and ctypes.get_errno() in (errno.EPERM, errno.ENOSYS)
    ):
        reached.append(number)
print(json.dumps(reached))
"""

#: Calls of x86_64 that Linux lets pass any filter; it ends a process that makes one itself.
UNFILTERED = (335, 336) if platform.machine() == "x86_64" else ()

#: Macros of the headers of aarch64.
AARCH64 = ("-D__ARCH_WANT_NEW_STAT", "-D__ARCH_WANT_SET_GET_RLIMIT", "-D__BITS_PER_LONG=64")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_confined_process_of_root_keeps_the_right_to_read_and_no_other(tmp_path):
    given = tmp_path / "given.csv"
    given.write_text("1")
    given.chmod(0o600)
    tmp_path.chmod(0o700)
    command = [sys.executable, "-P", "-c", SCRIPT, given]
    # Libraries that start threads are not in the environment of a reader.
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    found = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    gaps, text, users, capabilities = json.loads(found.stdout)
    assert (gaps, text) == ([], "1")
    assert 0 not in users
    assert capabilities == 1 << 2, "CAP_DAC_READ_SEARCH"


def test_a_call_that_is_not_in_the_list_does_not_reach_the_kernel():
    column = ("x86_64", "aarch64").index(platform.machine())
    listed = [*UNFILTERED, *(numbers[column] for numbers in confinement._CALLS.values())]
    command = [sys.executable, "-c", CALLER, json.dumps(listed)]
    found = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(found.stdout) == []


@pytest.mark.parametrize(
    ("column", "header", "flags"),
    [
        pytest.param(
            *(0, "asm/unistd_64.h", ()),
            marks=pytest.mark.skipif(platform.machine() != "x86_64", reason="the header is that of x86_64"),
        ),
        (1, "asm-generic/unistd.h", AARCH64),
    ],
)
def test_numbers_are_those_of_the_headers_of_the_kernel(column, header, flags):
    source = f"#include <{header}>\n" + "".join(f"@{name} __NR_{name}\n" for name in CALLS)
    command = ["cc", "-E", "-P", *flags, "-"]
    text = subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout
    words = [line[1:].split() for line in text.splitlines() if line.startswith("@")]
    found = {name: int(number) if number.isdecimal() else None for name, number in words}
    assert found == {name: numbers[column] for name, numbers in CALLS.items()}
