"""Compilation before the first use compiles every kernel of fits, searches and simulations."""

import json
import os
import subprocess
import sys

import pytest

#: Script that compiles the kernels, uses them, and prints which files each step has stored.
USE = """
import json
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.facade.warm_up import warm_up
from islands.kernels.jit_cache import cache_folder
from islands.systems.catalogue import make_record

def stored():
    return sorted(path.name for path in cache_folder().rglob("*.nbc"))

compiled = warm_up(lambda line: None)
before = stored()
record = make_record("bouc-wen-piezo", "authors", "estimation")[:1000]
identify(record, preset="hysteresis", population=20, generations=2, shooting=100)
fit(record, library="polynomial", max_terms=4).best.simulate(record)
print(json.dumps([compiled, before, stored()]))
"""


@pytest.mark.nightly
def test_search_and_fit_compile_nothing_after_the_warm_up(tmp_path):
    for first in (True, False):
        done = subprocess.run(
            [sys.executable, "-c", USE],
            env=os.environ | {"ISLANDS_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        compiled, before, after = json.loads(done.stdout)
        assert compiled is first
        assert len(before) > 10
        assert after == before
