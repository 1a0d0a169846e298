"""Small searches: a record and settings with which a generation takes milliseconds."""

import numpy as np

from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.individual import make_regressor
from islands.evolution.settings import Settings
from islands.records.dataset import Dataset

SMALL = Settings(
    population=24,
    generations=10,
    prune=0.3,
    tolerance=1e-4,
    max_terms=5,
    initial_terms=(1, 4),
    max_height=4,
    shooting=60,
)


def record(samples=400, inputs=1, seed=0, rate=25, **changes):
    """Return a record of noisy hysteresis, with equal bits in every process."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / rate
    u = np.column_stack([np.sin(time * (1 + 0.3 * i)) + 0.5 * np.sin(2.6 * time + i) for i in range(inputs)])
    y = np.zeros(samples)
    for k in range(2, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + np.sum(0.8 * rise - 0.3 * y[k - 1] * np.abs(rise))
    return Dataset(u, y + 1e-3 * rng.normal(size=samples), 1 / rate, **changes)


def islands_of(evaluator, generations, seed=3):
    """Return the island after every generation, starting with the first population."""
    island, _ = first_generation(0, seed, evaluator)
    islands = [island]
    for _ in range(generations):
        island, _ = step(island, evaluator)
        islands.append(island)
    return islands


def evolved(generations, setting=SMALL, seed=3, evaluator=None):
    """Return one island after some generations."""
    return islands_of(evaluator or Evaluator(record(), setting), generations, seed)[-1]


def exactly(island):
    """Return a text for exact comparison; equality of regressors compares only their text."""
    return repr(island)


def distinct_genes(genes):
    """Return the first gene of every regressor; genes that are zero are left out."""
    found = {}
    for gene in genes:
        item = make_regressor(gene)
        if item is not None:
            found.setdefault(item, gene)
    return found
