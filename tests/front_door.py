"""The command line as a process: what every acceptance test knocks at."""

import subprocess
import sysconfig
from pathlib import Path

ISLANDS = Path(sysconfig.get_path("scripts")) / "islands"


def islands(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ISLANDS, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=240
    )


def succeed(*arguments: object) -> str:
    done = islands(*arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def fail(*arguments: object) -> str:
    done = islands(*arguments)
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr
