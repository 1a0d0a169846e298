"""Description of the machine that a benchmark ran on; between machines only ratios are comparable."""

import ctypes
import multiprocessing
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from islands.distribution import read_version
from islands.export.fmu import find_compiler
from lab.speed.clock import cpu
from lab.speed.compiled_c import compile_model
from lab.speed.yardstick import measure_yardstick

#: Other packages whose versions influence the times.
_PACKAGES = ("numpy", "numba", "llvmlite", "scipy")


@dataclass(frozen=True, slots=True)
class Machine:
    """Machine and software of a benchmark.

    Attributes
    ----------
    processor : str
        Name of the processor as reported by the system.
    cores : int
        Number of cores of the system; other processes may use them as well.
    system, python : str
    compiler : str or None
        First line of the version text of the C compiler; None if there is no compiler.
    packages : dict of str to str
        Versions of the packages.
    yardstick_s : float
        Seconds of CPU of the loop of `measure_yardstick`.
    """

    processor: str
    cores: int
    system: str
    python: str
    compiler: str | None
    packages: dict[str, str]
    yardstick_s: float


def this_machine() -> Machine:
    """Describe the machine that runs this process."""
    return Machine(
        _processor(),
        multiprocessing.cpu_count(),
        f"{platform.system()} {platform.machine()}",
        platform.python_version(),
        _compiler(),
        {"islands": read_version(), **{name: version(name) for name in _PACKAGES}},
        measure_yardstick(0.1),
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
    command = find_compiler()
    if command is None:
        return None
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
    return (done.stdout.splitlines() or [command])[0]


#: C source of the peak measurement. The chains are independent of each other; their number fills every
#: pipeline and fits into the registers.
_SOURCE = """\
#if defined(__AVX512F__)
enum { BYTES = 64, CHAINS = 16 };
#elif defined(__AVX__)
enum { BYTES = 32, CHAINS = 12 };
#elif defined(__aarch64__)
enum { BYTES = 16, CHAINS = 24 };
#else
enum { BYTES = 16, CHAINS = 12 };
#endif
typedef double vector __attribute__((vector_size(BYTES)));

/* Returns the floating-point operations of that many rounds. */
double multiply_add(long rounds, double factor, double *result)
{
    vector chain[CHAINS], one = {0}, a, b;
    one += 1.0;
    a = one * factor;
    b = one * (1.0 - factor);
    for (int i = 0; i < CHAINS; ++i) chain[i] = one * (double)i;
    for (long round = 0; round < rounds; ++round)
        #pragma GCC unroll 32
        for (int i = 0; i < CHAINS; ++i) chain[i] = chain[i] * a + b;
    vector sum = chain[0];
    for (int i = 1; i < CHAINS; ++i) sum += chain[i];
    *result = sum[0];
    return 2.0 * rounds * CHAINS * (BYTES / sizeof(double));
}
"""

#: Compiler flags of the peak measurement.
_FLAGS = ("-O2", "-march=native", "-ffp-contract=off")

#: Rounds of one measurement.
_ROUNDS = 2_000_000

#: Measurements; the fastest counts.
_REPEATS = 7


def peak(folder: Path) -> float | None:
    """Return the multiplications and additions per second of one core; None if there is no compiler.

    Fused multiply-add is disabled as in the kernels, because it would make bits depend on the processor.
    """
    if find_compiler() is None:
        return None
    library = compile_model(_SOURCE, _FLAGS, folder)
    multiply_add = library.multiply_add
    multiply_add.restype = ctypes.c_double
    result = ctypes.c_double()
    best = 0.0
    for _ in range(_REPEATS):
        began = cpu()
        operations = multiply_add(ctypes.c_long(_ROUNDS), ctypes.c_double(1.0 - 1e-9), ctypes.byref(result))
        best = max(best, operations / (cpu() - began))
    return best
