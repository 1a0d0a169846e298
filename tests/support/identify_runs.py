"""Small runs of ``islands identify``: options, a record, and checks of results and errors."""

import numpy as np

from islands.evolution.engine import SerialEngine
from islands.evolution.presets import resolve_settings
from islands.records.dataset import Dataset

SMALL = (
    *("--preset", "hysteresis", "--set", "population=10", "--generations", "3", "--max-terms", "3"),
    *("--set", "shooting=50", "--set", "max_height=3"),
)
#: Options with one generation per epoch.
STEPWISE = (*SMALL, "--set", "migrate_every=1")
#: Options with two islands in this process.
TWO = (*STEPWISE, "--islands", "2", "--engine", "serial")
#: Columns of the record.
COLUMNS = ("--input", "u_V", "--output", "y_um")
#: Largest lag with trees of height 12.
DEEPEST = resolve_settings("hysteresis", {"max_height": 12}).maximum_lag


def record(samples=700, seed=0, dt=0.01):
    rng = np.random.default_rng(seed)
    u, y = 0.1 * np.cumsum(rng.normal(size=samples)), np.zeros(samples)
    # The validation data, a quarter, have inputs of the estimation data: they do not extrapolate.
    held = samples // 4
    u[-held:] = u[-held - 1 : -2 * held - 1 : -1]
    for k in range(3, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.3 * y[k - 1] * abs(rise)
    return Dataset(u, y + 0.001 * rng.normal(size=samples), dt, ("u_V",), "y_um")


def refused(found):
    code, out, error = found
    assert code == 2, found
    assert out == ""
    assert error.startswith("error: ")
    return error


def models(folder):
    return {path.name: path.read_bytes() for path in sorted((folder / "models").iterdir())}


class Broken(SerialEngine):
    """Engine that fails after the epoch that ends at generation 1."""

    def run(self, problem, start, stop):
        for epoch in super().run(problem, start, stop):
            yield epoch
            if epoch.archipelago.generation == 1:
                raise OSError(28, "No space left on device")
