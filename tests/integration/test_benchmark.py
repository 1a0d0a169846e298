"""The benchmark of the kernels runs, and its two simulations agree; how fast they are, it only prints."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).resolve().parents[1] / "benchmarks" / "kernel.py"


@pytest.mark.slow
def test_the_benchmark_compares_every_step_with_plain_numpy():
    command = [sys.executable, BENCHMARK, "--individuals", "2", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert figures.pop("samples") == 100_000
    assert set(figures) == {"poly", "general"}
    for figure in figures.values():
        assert len(figure.pop("workload")) == 12
        assert set(figure) >= {"simulation", "evaluation"}
        assert all(ours > 0.0 and theirs > 0.0 for ours, theirs in figure.values())
