"""Set-up writes the bytecode of the modules that commands load."""

import os
import subprocess
import sys

import pytest

from support.repository import ROOT

#: Script that runs a command and prints the loaded modules of packages, and those without bytecode.
PROGRAM = """
import sys
from pathlib import Path
from islands_api.cli import main
try:
    main()
finally:
    loaded = [getattr(each, "__spec__", None) for each in [*sys.modules.values()]]
    files = [each for each in loaded if each and each.cached]
    files = [each for each in files if each.name.partition(".")[0] not in sys.stdlib_module_names]
    missing = [each.name for each in files if not Path(each.cached).exists()]
    print(len(files), *missing, file=sys.stderr)
"""


@pytest.mark.nightly
def test_commands_compile_almost_no_module_after_the_set_up(tmp_path):
    """A few modules of libraries are loaded by what the commands do, and not by what the sources import."""
    environment = os.environ | {
        "PYTHONPYCACHEPREFIX": str(tmp_path / "bytecode"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }

    def run(*arguments: object) -> str:
        command = [sys.executable, *map(str, arguments)]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stderr

    run(ROOT / "deploy/packages/compile_modules.py")
    for command in (
        ("examples", "."),
        ("fit", "motor.csv", "--input", "drive_V", "--output", "speed_rad_s", "--out", "motor"),
        ("simulate", "motor", "motor.csv"),
        ("show", "motor"),
    ):
        count, *missing = run("-c", PROGRAM, *command).splitlines()[-1].split()
        assert len(missing) <= 0.02 * int(count), missing
