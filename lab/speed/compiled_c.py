"""Lower bound of the time of a simulation: C generated and compiled for one individual.

The C code does the same work as the kernel: shooting intervals as lanes of rows, with inlined expressions and
all numbers of rows and lanes known to the compiler. Compiling takes far longer than simulating, so a search
cannot use it; it shows the cost of a general kernel.
"""

import ctypes
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from islands.export.fmu import compile_library
from islands.export.languages.c import definition
from islands.expressions.primitives import SIGN
from islands.models.regressor import Regressor
from islands.records.dataset import Dataset
from lab.speed.expression_source import infix


def compile_model(source: str, flags: Sequence[str], folder: Path) -> ctypes.CDLL:
    """Compile C and load it.

    Parameters
    ----------
    folder : Path
        Folder for source and library; the file names are a hash of the content.

    Raises
    ------
    ModelError
        If there is no compiler, or if it rejects the source or a flag; the message is the compiler's.
    """
    name = hashlib.sha256("\n".join((source, *flags)).encode()).hexdigest()
    written, library = folder / f"{name}.c", folder / f"{name}.so"
    written.write_text(source, encoding="ascii")
    compile_library(written, library, flags)
    return ctypes.CDLL(str(library))


#: Intervals per row.
LANES = 104

#: Sets of compiler flags; the fastest result counts. The first set rounds as the kernels do.
FLAGS = (
    ("-O3", "-march=native", "-ffp-contract=off"),
    ("-O3", "-march=native"),
)

_TEMPLATE = """\
#include <string.h>
enum {{ LANES = {lanes}, WARM_UP = {warm_up}, STEPS = {steps} }};

{sign}
/* Rows [block][time][lane] of the input and of the measured output; y holds the rows of one block. */
void simulate(const double *restrict input, const double *restrict measured, long blocks,
              const double *restrict theta, double *restrict y, double *restrict squared)
{{
    {weights}
    for (long block = 0; block < blocks; ++block) {{
        const double *u = input + block * (WARM_UP + STEPS) * LANES;
        const double *m = measured + block * (WARM_UP + STEPS) * LANES;
        double *error = squared + block * LANES;
        memcpy(y, m, sizeof(double) * WARM_UP * LANES);
        memset(error, 0, sizeof(double) * LANES);
        for (long k = WARM_UP; k < WARM_UP + STEPS; ++k) {{
            /* A row is written and earlier rows are read: lanes are independent. */
            #pragma GCC ivdep
            for (long lane = 0; lane < LANES; ++lane) {{
                double value = 0.0;
                {terms}
                y[k * LANES + lane] = value;
                double off = value - m[k * LANES + lane];
                error[lane] += off * off;
            }}
        }}
    }}
}}
"""


@dataclass(frozen=True, slots=True, eq=False)
class RowsPointer:
    """Record of one input in rows, shape (blocks, warm_up + interval, `LANES`).

    Surplus lanes of the last block repeat the first interval. Only whole intervals are simulated.
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    lanes: int
    warm_up: int
    interval: int


def row_pointers(record: Dataset, warm_up: int, interval: int) -> RowsPointer:
    """Lay out the whole intervals of a record."""
    lanes = (record.samples - warm_up) // interval
    blocks = -(-lanes // LANES)
    start = np.zeros(blocks * LANES, np.int64)
    start[:lanes] = interval * np.arange(lanes)
    samples = start.reshape(blocks, 1, LANES) + np.arange(warm_up + interval)[:, None]
    u, y = (_copy_aligned(signal[samples]) for signal in (record.u[:, 0], record.y))
    return RowsPointer(u, y, lanes, warm_up, interval)


def c_source_of_model(regressors: Sequence[Regressor], warm_up: int, interval: int) -> str:
    """Return the C source of the simulation of an individual."""

    def sample(channel: int, lag: int) -> str:
        return f"{'yu'[channel]}[(k - {lag}) * LANES + lane]"

    terms = [
        f"value += theta_{place} * {infix(item.expression, sample)};" for place, item in enumerate(regressors)
    ]
    weights = [f"const double theta_{place} = theta[{place}];" for place in range(len(regressors))]
    return _TEMPLATE.format(
        lanes=LANES,
        warm_up=warm_up,
        steps=interval,
        sign=definition(SIGN, SIGN.name),
        weights="\n    ".join(weights),
        terms="\n                ".join(terms),
    )


def simulation(
    regressors: Sequence[Regressor],
    theta: Sequence[float],
    rows: RowsPointer,
    flags: Sequence[str],
    folder: Path,
) -> Callable[[], float]:
    """Compile the simulation of an individual; the function returns the sum of squared errors.

    Raises
    ------
    ModelError
        If there is no compiler, or if it fails.
    """
    library = compile_model(c_source_of_model(regressors, rows.warm_up, rows.interval), flags, folder)
    squared = _copy_aligned(np.zeros((len(rows.u), LANES)))
    arrays = (np.array(theta), _copy_aligned(np.zeros(rows.u.shape[1:])), squared)
    weights, y, error = (array.ctypes.data_as(ctypes.c_void_p) for array in arrays)
    u, measured = (array.ctypes.data_as(ctypes.c_void_p) for array in (rows.u, rows.y))
    blocks = ctypes.c_long(len(rows.u))
    simulate = library.simulate
    simulate.restype = None

    def call() -> float:
        simulate(u, measured, blocks, weights, y, error)
        # The closure refers to the arrays, so that they live as long as the function that writes them.
        return float(arrays[2].reshape(-1)[: rows.lanes].sum())

    return call


def _copy_aligned(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Copy values to the start of a cache line: a vector that crosses two lines costs two loads."""
    buffer = np.empty(values.nbytes + 64, np.uint8)
    begin = -buffer.ctypes.data % 64
    copy = buffer[begin : begin + values.nbytes].view(np.float64).reshape(values.shape)
    copy[:] = values
    return copy
