"""FMUs in confined processes: the same numbers as in this process, and nothing that an FMU could harm."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from islands.diagnosis.calibration.preview import CalibrationPreview, preview_calibration
from islands.errors import ModelError
from islands.records.dataset import Dataset
from islands.simulators.fmu.fmi_description import read_description
from islands.simulators.fmu.instance import LOCAL_FMUS, FmuSource
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import parse_spec
from islands_service.domain.uploaded_fmu import describe_fmu, read_fmu
from islands_service.intake import confined_fmu
from islands_service.intake.confined_fmu import open_confined
from support.oscillator_fmus import compile_oscillator, make_attacks, write_oscillator

pytestmark = pytest.mark.ci

LIMITS = 6_000_000_000, 600.0

#: Runs the attacks of a library in a process that nothing confines.
ATTACK = """
import ctypes, sys
attack = ctypes.CDLL(sys.argv[1]).attack
attack.restype = ctypes.c_char_p
print(attack().decode())
"""

#: Attacks that every Linux allows; others depend on the user and on the settings of the kernel.
HARM = {
    *("chmod", "chmod-folder", "fchmod", "chown", "utimensat", "truncate", "open-truncate", "read", "write"),
    *("link", "rename", "unlink", "mkdir", "list", "environment", "lock", "socket", "shmget", "msgget"),
    *("semget", "memfd", "thread", "fork", "signal", "signal-by-file", "priority"),
}


def calibrate(fmu: Path, source: FmuSource = LOCAL_FMUS) -> CalibrationPreview:
    u = np.sin(np.arange(300) / 5.0)
    record = Dataset(u, 0.01 * np.roll(u, 3), 0.01)
    return preview_calibration(record, make_simulator(parse_spec(f"fmu:{fmu}"), record, None, source))


@pytest.mark.parametrize(("interface", "most"), [("ModelExchange", 200_000), ("CoSimulation", 700)])
def test_a_confined_fmu_gives_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interface: str, most: int
) -> None:
    monkeypatch.setattr(confined_fmu, "_MAX_SAMPLES", most)
    fmu = write_oscillator(tmp_path / "mass.fmu", interfaces=interface, resources=True)
    local = calibrate(fmu)
    document = describe_fmu(read_description(str(fmu)))
    calls: list[int] = []
    check = lambda: calls.append(1)  # noqa: E731
    with open_confined(fmu, read_fmu(document, "mass.fmu"), *LIMITS, check) as source:
        confined = calibrate(fmu, source)
    np.testing.assert_array_equal(confined.fit.output, local.fit.output)
    np.testing.assert_array_equal(confined.fit.values, local.fit.values)
    assert calls, "a job can be cancelled during simulations"


def test_a_description_survives_its_document(tmp_path: Path) -> None:
    description = read_description(str(write_oscillator(tmp_path / "mass.fmu", events=True)))
    assert read_fmu(describe_fmu(description), description.path) == description


def list_attributes(folder: Path) -> list[object]:
    """Return modes, owners, times, extended attributes and contents of a folder and what is in it."""
    found: list[object] = []
    for path in (folder, *sorted(folder.rglob("*"))):
        status = path.stat()
        found += [path.name, status.st_mode, status.st_uid, status.st_mtime_ns, os.listxattr(path)]
        found += [path.read_bytes()] if path.is_file() else []
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="the confinement is that of Linux")
def test_a_harmful_fmu_succeeds_with_nothing(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    (data / "database").write_text("jobs")
    macros = make_attacks(data)
    fmu = write_oscillator(tmp_path / "mass.fmu", macros=macros)
    document = describe_fmu(read_description(str(fmu)))
    before = list_attributes(data)
    with (
        pytest.raises(ModelError, match=r"mass\.fmu cannot be loaded: .*: attempts that succeed:$"),
        open_confined(fmu, read_fmu(document, "mass.fmu"), *LIMITS, lambda: None),
    ):
        pass
    assert list_attributes(data) == before
    # The same code does all of it where nothing confines it.
    library = tmp_path / "library"
    library.write_bytes(compile_oscillator(3, *macros))
    free = subprocess.run([sys.executable, "-c", ATTACK, library], capture_output=True, text=True, check=True)
    assert set(free.stdout.partition(":")[2].split()) >= HARM, free
    assert list_attributes(data) != before
