"""A primitive of a user and a record of a law that requires it."""

import numpy as np

import islands
from islands.records.dataset import Dataset

#: Half of the width of the dead zone.
PLAY = 0.5


def dead_zone(a):
    return max(0.0, a - PLAY) + min(0.0, a + PLAY)


DEAD_ZONE = islands.primitive("dead_zone", dead_zone, parity=-1, c="return a - fmax(-0.5, fmin(0.5, a));")

#: Settings of a search that finds the law in a fraction of a second.
SEARCH = {
    "preset": "narx",
    "primitives": ("mul", DEAD_ZONE),
    "library": "",
    "population": 40,
    "generations": 8,
    "max_terms": 2,
    "max_height": 2,
    "shooting": 50,
    "estimator": "shooting",
}

#: The law of the record.
LAW = {"y(k-1)": 0.7, "dead_zone(u(k-1))": 0.4}


def law():
    """Return the law as a model."""
    table = islands.PRIMITIVES | {"dead_zone": DEAD_ZONE}
    return islands.make_model([(islands.parse(text, table), value) for text, value in LAW.items()], dt=0.1)


def record(samples=300):
    u = np.random.default_rng(3).uniform(-2.0, 2.0, samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.7 * y[k - 1] + 0.4 * dead_zone(u[k - 1])
    return Dataset(u, y, 0.1)
