"""A small record and a few individuals of each random kind."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands_measurements.speed.workload import monomial, random_workload, tree

WARM_UP, INTERVAL = 26, 20


@pytest.fixture(scope="session")
def record():
    """Return a record of whole intervals only, more of them than a row of compiled C has lanes."""
    rng = np.random.default_rng(5)
    samples = WARM_UP + 130 * INTERVAL
    u = np.cumsum(rng.normal(size=samples)) / 20
    return Dataset(u - u.mean(), np.sin(u) + 0.01 * rng.normal(size=samples), 0.001)


@pytest.fixture(scope="session")
def candidates():
    return (*random_workload(monomial, 3), *random_workload(tree, 3), *random_workload(monomial, 1, terms=1))
