"""Scripts of small peers that need NumPy only, and a set on which they run."""

from pathlib import Path

import numpy as np

from islands.benchmarks.definition import Benchmark, BenchmarkData, BenchmarkTest
from islands.benchmarks.peers.catalogue import Peer
from islands.records.dataset import Dataset, join

#: Least squares of ``y(k)`` on its lags, those of the input, and a constant.
LEAST_SQUARES = """
import numpy as np

def list_candidates(task):
    return [{"lags": lags} for lags in (1, 2, 30) if lags <= task.known]

def fit(recordings, candidate, task):
    lags = candidate["lags"]
    parts = [task.make_rows(each, lags) for each in recordings]
    rows, y = (np.vstack([part[place] for part in parts]) for place in (0, 1))
    parameters = np.linalg.lstsq(np.hstack([rows, np.ones_like(y[:, :1])]), y, rcond=None)[0]

    def predict(u, y):
        simulated = np.vstack([y, np.zeros((len(u) - lags, y.shape[1]))])
        for k in range(lags, len(u)):
            past = [simulated[k - lags : k][::-1].ravel(), u[k - lags : k + 1][::-1].ravel()]
            simulated[k] = np.concatenate([*past, [1.0]]) @ parameters
        return simulated

    return task.run_freely(predict, lags)
"""

SET = Benchmark("A lag.", {}, "mV", 1e3, "a rule", "doi 10.1/2", "MIT", lambda _folder: make_data())


def make_peer(folder: Path, script: str, **options: bool) -> Peer:
    """Write a script, and return its peer."""
    path = folder / "script.py"
    path.write_text(script, encoding="utf-8")
    return Peer("tiny", "1.2", path, "A setting.", **options)


def make_data(offset: float = 0.0) -> BenchmarkData:
    """Return two recordings and a test of two segments; the scored outputs of the test have an offset."""
    test = join((_simulate(60, 3), _simulate(50, 4)))
    shifted = np.array(test.y)
    for begin, end in test.bounds:
        shifted[begin + 5 : end] += offset
    record = Dataset(test.u, shifted, test.dt, segments=test.segments)
    return BenchmarkData(join((_simulate(200, 1), _simulate(100, 2))), {"two": BenchmarkTest(record, 5, 5)})


def _simulate(samples: int, seed: int) -> Dataset:
    """Return ``y(k) = 1.2 y(k-1) - 0.4 y(k-2) + u(k-1)``; no mean is zero."""
    u, y = np.random.default_rng(seed).standard_normal(samples) + 2.0, np.full(samples, 20.0)
    for k in range(2, samples):
        y[k] = 1.2 * y[k - 1] - 0.4 * y[k - 2] + u[k - 1]
    return Dataset(u, y, 0.1)
