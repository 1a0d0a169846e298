"""The machine that a benchmark ran on: figures of two machines compare as ratios alone."""

import multiprocessing
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from islands.benchmark.compiler import compiler

#: Packages whose version a time depends on.
_PACKAGES = ("islands", "numpy", "numba", "llvmlite", "scipy")


@dataclass(frozen=True, slots=True)
class Machine:
    """What a benchmark ran on.

    Attributes
    ----------
    processor : str
        Its name as the system gives it.
    cores : int
        That the system has; others may use them as well.
    system, python : str
    compiler : str or None
        First line of what the C compiler says of itself; None where there is none.
    packages : dict of str to str
        Versions.
    """

    processor: str
    cores: int
    system: str
    python: str
    compiler: str | None
    packages: dict[str, str]


def this_machine() -> Machine:
    """Describe the machine that this runs on."""
    return Machine(
        _processor(),
        multiprocessing.cpu_count(),
        f"{platform.system()} {platform.machine()}",
        platform.python_version(),
        _compiler(),
        {name: version(name) for name in _PACKAGES},
    )


def _processor() -> str:
    described = Path("/proc/cpuinfo")
    if described.exists():
        for line in described.read_text(encoding="utf-8").splitlines():
            name, _, text = line.partition(":")
            if name.strip() == "model name":
                return text.strip()
    return platform.processor() or platform.machine()


def _compiler() -> str | None:
    command = compiler()
    if command is None:
        return None
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
    return (done.stdout.splitlines() or [command])[0]
