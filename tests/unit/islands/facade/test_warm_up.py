"""Compilation before the first use compiles every kernel of fits, searches and simulations."""

import json
import os
import subprocess
import sys

import pytest
from llvmlite.binding import get_host_cpu_name

#: Script that compiles the kernels, uses them, and prints which files each step has stored.
USE = """
import json
import numpy as np
from scipy.signal import lfilter
from islands.records.dataset import Dataset
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.facade.warm_up import warm_up
from islands.kernels.jit_cache import cache_folder
from islands.systems.catalogue import make_record

def stored():
    return sorted(path.name for path in cache_folder().rglob("*.nbc"))

compiled = warm_up(lambda line: None)
before = stored()
rng = np.random.default_rng(1)
u = np.repeat(rng.uniform(-1, 1, 50), 10)
y = lfilter([0, 0.2], [1, -1.2, 0.4], u + u**2 / 2) + rng.normal(0, 0.005, 500)
piezo, process = make_record("bouc-wen-piezo", "authors", "estimation")[:1000], Dataset(u, y, 0.01)
identify(piezo, preset="hysteresis", population=20, generations=2, shooting=100)
identify(process, population=40, generations=5)
fit(process).best.simulate(process)
print(json.dumps([compiled, before, stored()]))
"""


@pytest.mark.nightly
def test_search_and_fit_compile_nothing_after_the_warm_up(tmp_path):
    """A processor that is named explicitly has no code in the archive."""
    variables = {"ISLANDS_CACHE_DIR": str(tmp_path), "NUMBA_CPU_NAME": get_host_cpu_name()}
    for first in (True, False):
        done = subprocess.run(
            [sys.executable, "-c", USE],
            env=os.environ | variables,
            capture_output=True,
            text=True,
            check=True,
        )
        compiled, before, after = json.loads(done.stdout)
        assert compiled is first
        assert len(before) > 10
        assert after == before
