"""Every long command, stopped by a signal after a part of its work: it ends soon with its result so far."""

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from support.command_line import ISLANDS, succeed, write_offset

#: Options of an evolution that takes some seconds.
SEARCH = ("--generations", "40", "--set", "population=60", "--max-terms", "6")

PIEZO = ("piezo.csv", "--input", "u_V", "--output", "y_um", "--rows", "0:1000")
TWO = ("two.csv", "--input", "u_V", "--output", "x_V,y_V")
OUT = ("--out", "out")

#: Long commands by name.
COMMANDS: dict[str, tuple[str, ...]] = {
    "inspect": ("inspect", "long.csv", *OUT),
    "fit": ("fit", *PIEZO, *OUT),
    "fit-outputs": ("fit", *TWO, *OUT),
    "identify": ("identify", *PIEZO, *SEARCH, "--engine", "serial", *OUT),
    "identify-ray": ("identify", *PIEZO, *SEARCH, "--preset", "hysteresis", "--islands", "2", *OUT),
    "identify-outputs": ("identify", *TWO, *SEARCH, "--engine", "serial", *OUT),
    "diagnose": (
        *("diagnose", "motor.csv", "--input", "drive_V", "--output", "speed_rad_s", "--rows", "0:500"),
        *("--simulation", "linear:1", *OUT),
    ),
    "self-test": (
        *("diagnose", "records/2026-11-01.csv", "--input", "u_V", "--output", "y_um"),
        *("--simulation", "column:theirs_um", "--self-test", *OUT),
    ),
    "plan": (
        *("diagnose", "--plan", "motor.csv", "--input", "drive_V", "--output", "speed_rad_s"),
        *("--simulation", "linear:1", *OUT),
    ),
    "trials": (
        *("trials", "--count", "1", "--clean", "4", "--open-set", "0", "--effects", "sensor-gain"),
        *("--workers", "1", "--json", "out.json"),
    ),
    "bench": ("bench", "--quick", *OUT),
    "demo": ("demo", *OUT),
    "monitor": (
        *("monitor", "records", "--input", "u_V", "--output", "y_um"),
        *("--simulation", "column:theirs_um", "--set", "settle=0", *OUT),
    ),
}

#: Seconds of CPU of one core after a signal, for a busy machine. Two seconds pass on a quiet one.
LIMIT = 2.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records of all commands; the kernels are compiled."""
    base = tmp_path_factory.mktemp("stopped")
    succeed("examples", base)
    write_two_outputs(base / "two.csv")
    (base / "records").mkdir()
    for day in range(1, 30):
        write_offset(base / f"records/2026-11-{day:02d}.csv")
    rows = (f"{k / 100},{k % 17},{k % 13}" for k in range(400_000))
    (base / "long.csv").write_text("\n".join(["t_s,u_V,y_V", *rows]))
    return base


def write_two_outputs(path: Path) -> None:
    """Write a record of 1500 samples with two outputs that depend on each other."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.normal(size=150), 10)
    x, y = np.zeros(1500), np.zeros(1500)
    for k in range(1, 1500):
        x[k] = 0.8 * x[k - 1] + 0.2 * u[k - 1] - 0.1 * y[k - 1]
        y[k] = 0.7 * y[k - 1] + 0.3 * x[k - 1]
    noisy = [each + 0.01 * rng.normal(size=1500) for each in (x, y)]
    rows = np.column_stack([0.1 * np.arange(1500), u, *noisy])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header="t_s,u_V,x_V,y_V", comments="")


def start(words: tuple[str, ...], folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [ISLANDS, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell ignores SIGINT in background processes, and the child would inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no thread yet
    )


def read_cpu(pid: int) -> float:
    """Return the seconds of CPU that a process has used, without its children."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stop(process: subprocess.Popen[str], number: signal.Signals) -> tuple[float, str, str]:
    """Send a signal as a terminal or a process manager does; return the CPU time after it, and the output."""
    before = used = read_cpu(process.pid)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    deadline = time.monotonic() + 60.0
    while process.poll() is None and time.monotonic() < deadline:
        try:
            used = max(used, read_cpu(process.pid))
        except OSError:
            break
        time.sleep(0.005)
    if process.poll() is None:
        process.kill()
    out, err = process.communicate(timeout=10.0)
    return used - before, out, err


def clear(folder: Path) -> None:
    shutil.rmtree(folder / "out", ignore_errors=True)
    (folder / "out.json").unlink(missing_ok=True)


@pytest.fixture(scope="module")
def durations(folder: Path) -> Callable[[str], float]:
    """Return the CPU time of a whole command, in its own process."""

    @cache
    def measure(name: str) -> float:
        clear(folder)
        process, used = start(COMMANDS[name], folder), 0.0
        while process.poll() is None:
            with suppress(OSError):
                used = max(used, read_cpu(process.pid))
            time.sleep(0.02)
        _, err = process.communicate()
        assert process.returncode == 0, err
        return used

    return measure


def check_kept(folder: Path, err: str) -> None:
    """Check that the message is true: a result that was kept can be read."""
    results = sorted(folder.glob("out/**/result.json"))
    if "no result to keep" in err or err.strip().endswith("\nstopped"):
        assert not results
    for path in results:
        assert succeed("show", path.parent)
    if (diagnosis := folder / "out" / "discrepancy.json").exists():
        left_out = json.loads(diagnosis.read_text())["left_out"]
        assert all(step in err for step in left_out)
        assert left_out or "which is complete" in err
    for name in ("plan.json", "fits.json"):
        if (folder / "out" / name).exists():
            assert json.loads((folder / "out" / name).read_text())


@pytest.mark.parametrize(
    ("name", "percent", "number"),
    [
        pytest.param("fit", 80, signal.SIGTERM, marks=pytest.mark.ci),
        *(
            pytest.param(name, percent, number, marks=pytest.mark.nightly)
            for name in COMMANDS
            for percent, number in [
                *((percent, signal.SIGINT) for percent in (20, 40, 60, 70, 75, 85, 95)),
                *((percent, signal.SIGTERM) for percent in (50, 90)),
            ]
        ),
    ],
)
def test_stopped_command_ends_soon_and_keeps_its_result(
    folder: Path, durations: Callable[[str], float], name: str, percent: int, number: signal.Signals
) -> None:
    duration = durations(name)
    clear(folder)
    process = start(COMMANDS[name], folder)
    while process.poll() is None and read_cpu(process.pid) < percent / 100 * duration:
        time.sleep(0.005)
    if process.poll() is not None:  # the work of other processes takes another share of the time
        process.communicate()
        return
    used, _, err = stop(process, number)
    assert "Traceback" not in err
    if process.returncode == 0 and "stopped" not in err:
        return  # the command ended at the moment of the signal
    assert used < LIMIT, err
    if number == signal.SIGINT:
        assert process.returncode == 130, err
    else:
        assert process.returncode == (0 if "has the result so far" in err else 143), err
    check_kept(folder, err)
