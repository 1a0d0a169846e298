"""The source fixes the order of every sum: no bit depends on the width of the processor's registers."""

import os
import platform
import subprocess
import sys

import pytest
from llvmlite.binding import get_host_cpu_features

#: Target processors, and the features that the host needs to run their code.
PROCESSORS = {
    "nehalem": {"sse4.2", "popcnt"},
    "haswell": {"avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe"},
    "skylake-avx512": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "clwb", "adx"},
}

#: Widest registers of each processor.
REGISTERS = {"nehalem": "xmm", "haswell": "ymm", "skylake-avx512": "zmm"}

DIGEST = """
import hashlib
import numpy as np
from islands.records.dataset import Dataset
from islands.estimation.structure_selection.froe import froe
from islands.estimation.least_squares import factorise
from islands.kernels import simulate as kernel
from islands.kernels.population import (
    Groups, PopulationContext, SelectedTerms, empty_results, empty_terms, evaluate,
)
from islands.kernels.err_selection import OUTPUT
from islands.expressions.tree import (Lagged)
from islands.models.narx import Model
from islands.expressions.parsing import parse
from islands.models.regressor import regressor
from islands.program.regressor_matrix import gram_matrix, regressor_matrix, select_rows
from islands.kernels.pair_table import pair_table
from islands.program.term_pool import TermPool
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound, multiple_shooting

texts = ["y(k-1)", "y(k-2)", "u(k-1)", "u(k-2)", "u(k-3)", "u(k-1)*y(k-1)", "u(k-2)^3*y(k-1)",
         "sign(u(k-1) - u(k-2))*u(k-2)", "tanh(y(k-3)) + u(k-3)^2", "y(k-1)/(2 + abs(u(k-4)))"]
terms = [regressor(parse(text))[1] for text in texts]
count = len(terms)
rng = np.random.default_rng(0)
u, y = rng.normal(size=3100).cumsum() / 20, np.zeros(3100)
for k in range(2, 3100):
    y[k] = 0.6 * y[k-1] + 0.2 * y[k-2] + 0.3 * u[k-1] - 0.1 * np.tanh(u[k-1] * y[k-1])
record = Dataset(u, y + 0.01 * rng.normal(size=3100), 0.1, segments=(2200, 5, 895))
psi = regressor_matrix([*terms, Lagged(0, 0)], record, 4)
gram = gram_matrix([*terms, Lagged(0, 0)], record, 4)
made, chosen = factorise(psi[:-1], psi[-1]), froe(gram)
found = {"columns": psi, "gram": gram, "triangle": made.triangle, "projection": made.projection,
         "order": np.array(chosen.order), "err": np.array(chosen.err)}

store = TermPool()
store.terms([Lagged(0, 0), *terms])
sizes = np.array([count, 4, 6, 3])
structures = np.zeros((4, count), np.int64)
for row, size in zip(structures, sizes):
    row[:size] = np.arange(size) + 1
structures[3, :3] = 3, 4, 5
weight = np.ones(count + 1)
plain = np.empty((count + 1, 0)), np.empty(0), np.empty(0), np.empty(0, np.int64)
clusters = Groups(np.array([-1, 0, 0, 1, 1, 1, *[-1] * (count - 5)]), weight, np.array([1.0, 0.0]), 1, *plain)
free = Groups(np.full(count + 1, -1), weight, np.empty(0), 0, *plain)
for name, groups in (("clusters", clusters), ("free", free)):
    for interval in (1, 50, 1000):
        cut = layout(record, 4, interval)
        selected, results = empty_terms(4, count), empty_results(4, count)
        for array in (*selected, *results):
            array.fill(0)
        context = PopulationContext(0, -1, OUTPUT, 1e-4, store.nodes, groups, pair_table(1 << 16),
                                    select_rows(record, 4), cut, divergence_bound(record.y))
        pruned = np.array([True, False, False, False])
        given = SelectedTerms(structures, sizes)
        evaluate(given, pruned, np.full(count + 1, np.inf), context, selected, results)
        written = selected._asdict() | results._asdict()
        found |= {f"{name}, {interval}, {part}": array for part, array in written.items()}
        print(name, interval, "width", cut.width, "status", results.status)
model = Model(tuple(terms[:4]), tuple(found["free, 50, theta"][1][:4].tolist()), ("u",), "y", 0.1)
for interval in (1, 3, 50, None):
    simulated = multiple_shooting(model, record, interval)
    found[f"simulation, {interval}"] = np.append(simulated.y, simulated.mean_squared_error)
for name, array in found.items():
    print(name, hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest())
code = "".join(kernel.simulate.inspect_asm().values())
print(max((name for name in ("xmm", "ymm", "zmm") if f"%{name}" in code), default="none"))
"""


def digest(folder, processor=None):
    """Return the digest of every result, and the widest registers of the code that computed them."""
    environment = os.environ | {"ISLANDS_CACHE_DIR": str(folder / (processor or "host"))}
    if processor:
        # Without a list of features Numba would add those of the host.
        environment |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    done = subprocess.run(
        [sys.executable, "-c", DIGEST], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    *results, registers = done.stdout.splitlines()
    return results, registers


@pytest.mark.nightly
@pytest.mark.timeout(900)
@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="names of x86 processors")
def test_bits_do_not_depend_on_the_processor(tmp_path):
    expected, _ = digest(tmp_path)
    # The structure with lags of u only is infeasible; all others succeed.
    assert expected[0] == "clusters 1 width 104 status [0 0 0 4]"
    assert expected[5] == "free 1000 width 8 status [0 0 0 0]"
    assert len(expected) == 46
    host = {name for name, has in get_host_cpu_features().items() if has}
    for processor in (name for name, needed in PROCESSORS.items() if needed <= host):
        assert digest(tmp_path, processor) == (expected, REGISTERS[processor]), processor
