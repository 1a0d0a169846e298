"""A record and settings with which an identification takes less than a second, and recording helpers."""

from functools import partial

import numpy as np

from islands.facade.identify import identify as identify_with_default
from islands.records.dataset import Dataset

#: Identification with a fixed preset: the default tries several kinds of models first.
identify = partial(identify_with_default, preset="hysteresis")

#: All tuned settings of the presets are set here, so that tests do not depend on their values.
BUDGET = {
    "population": 30,
    "generations": 4,
    "max_terms": 5,
    "max_height": 5,
    "initial_terms": (2, 5),
    "shooting": 200,
    "elite": 0.2,
    "crossover": 0.4,
    "mutation": 1.0,
    "prune": 0.1,
    "tolerance": 1e-9,
    "outer": 0.7,
    "library": "phi-polynomial",
    "library_degree": 5,
    "library_lags": 3,
    "swap_search": False,
    "refine": False,
    "average": "1",
    "feedthrough": "no",
    "from_library": 0.6,
    "migrate_every": 1,
}


def record(samples=3000, seed=0, noise=2e-3, **changes):
    """Return a record of hysteresis under three sines that no library contains exactly."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) * 1e-2
    u = sum(
        a * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for a, f in ((1, 0.35), (0.6, 0.83), (0.4, 1.4))
    )
    y = np.zeros(samples)
    for k in range(2, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.35 * np.tanh(2 * y[k - 1]) * abs(rise) + 0.1 * u[k - 1] ** 2 * rise
    return Dataset(u, y + noise * rng.normal(size=samples), 1e-2, **changes)


def record_states(states):
    """Return a callback that records states; its return value must have no effect."""

    def callback(state, settings):
        assert settings.population == BUDGET["population"]
        states.append(state)
        return True

    return callback


def parameters(result):
    return [(fitted.model.regressors, fitted.model.parameters) for fitted in result.models]


def two_inputs(seed):
    """Return a record of 1200 samples with a second input that has no effect."""
    single = record(1200, seed=seed)
    u2 = np.cumsum(np.random.default_rng(seed).normal(size=1200)) / 50
    return Dataset(np.column_stack([single.u[:, 0], u2]), single.y, 1e-2)
