"""Each command starts with the modules that it needs: their number and the large packages have limits."""

import subprocess
import sys

import pytest

from islands.persistence.models import write_model
from islands.systems.published_models import get_published_model
from support.levels import nightly_but

PROGRAM = """
import sys
from islands_api.cli import main
try:
    main()
finally:
    large = {"matplotlib", "numba", "scipy", "scipy.signal"} & set(sys.modules)
    print(len(sys.modules), *sorted(large), file=sys.stderr)
"""

#: Largest number of modules of a command, a few more than measured, and the large packages it loads.
LIMITS = {
    "--version": (280, ""),
    "fit --help": (715, ""),
    "inspect {record}": (1095, "numba scipy"),
    "jobs --help": (900, ""),
    "jobs show --url http://127.0.0.1:9": (850, ""),
    "show {model}": (610, ""),
    "fit {record} --input u_V --output y_um --figures none --force --out {folder}": (1360, "numba scipy"),
    "simulate published:13 {record} --input u_V --output y_um": (1240, "numba scipy"),
    # Other processes draw the report.
    "diagnose {record} --input u_V --output y_um --rows 0:600 --simulation linear:1 --workers 2 --force "
    "--out {folder}": (1495, "numba scipy"),
}

#: Commands of the level ci: those that neither simulate nor diagnose.
QUICK = [command for command in LIMITS if not command.startswith(("simulate", "diagnose"))]


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    done = subprocess.run([sys.executable, "-m", "islands", "examples", folder], check=False)
    assert done.returncode == 0
    write_model(get_published_model("13").model, folder / "model.json")
    return folder / "piezo.csv"


@pytest.mark.ci
@pytest.mark.parametrize("command", nightly_but(QUICK, LIMITS))
def test_a_command_loads_the_modules_that_it_needs(command, record):
    names = {"record": record, "model": record.parent / "model.json", "folder": record.parent / "fit"}
    arguments = [part.format(**names) for part in command.split()]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=False
    )
    count, *large = done.stderr.splitlines()[-1].split()
    most, allowed = LIMITS[command]
    assert int(count) <= most
    assert " ".join(large) == allowed
