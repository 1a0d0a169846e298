"""The processor's peak: multiplications and additions in registers alone, measured beside the kernels."""

import ctypes
from pathlib import Path

from islands.benchmark.clock import cpu
from islands.benchmark.compiler import compiled, compiler

#: Each chain waits for itself alone; so many of them fill every pipe, and fit into the registers.
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

_FLAGS = ("-O2", "-march=native", "-ffp-contract=off")
_ROUNDS, _REPEATS = 2_000_000, 7


def peak(folder: Path) -> float | None:
    """Return multiplications and additions per second of one core, None where there is no compiler.

    Fused multiply-add is left out, as in the kernels: it would make bits depend on the processor.
    """
    if compiler() is None:
        return None
    library = compiled(_SOURCE, _FLAGS, folder)
    multiply_add = library.multiply_add
    multiply_add.restype = ctypes.c_double
    result = ctypes.c_double()
    best = 0.0
    for _ in range(_REPEATS):
        began = cpu()
        operations = multiply_add(ctypes.c_long(_ROUNDS), ctypes.c_double(1.0 - 1e-9), ctypes.byref(result))
        best = max(best, operations / (cpu() - began))
    return best
