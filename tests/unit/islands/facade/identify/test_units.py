"""`islands.identify` on one record in different units."""

import numpy as np
import pytest

import islands
from islands.records.dataset import Dataset

CHANGES = {
    "preset": "narx",
    "primitives": ("mul", "div"),
    "library": "",
    "population": 40,
    "generations": 6,
    "max_terms": 3,
    "max_height": 1,
    "shooting": 50,
}


def identified(volts=0, amperes=0, metres=0):
    """Identify a ratio of two inputs in units of powers of two."""
    rng = np.random.default_rng(1)
    u = rng.uniform(1.0, 3.0, (300, 2))
    u[::7, 1] = 0.0
    y = np.zeros(300)
    for k in range(1, 300):
        ratio = u[k - 1, 0] / u[k - 1, 1] if u[k - 1, 1] else 0.0
        y[k] = 0.6 * y[k - 1] + 0.8 * ratio + 0.01 * rng.standard_normal()
    record = Dataset(np.ldexp(u, [volts, amperes]), np.ldexp(y, metres), 0.1)
    return islands.identify(record, **CHANGES)


@pytest.fixture(scope="module")
def reference():
    return identified()


@pytest.mark.ci
@pytest.mark.parametrize("units", [(-20, 10, 30), pytest.param((-40, -40, -40), marks=pytest.mark.nightly)])
def test_models_and_errors_scale_exactly_with_the_units(reference, units):
    found = identified(*units)
    pairs = [sorted(each.models, key=lambda model: model.model.size) for each in (reference, found)]
    for here, there in zip(*pairs, strict=True):
        assert there.model.parameter_names == here.model.parameter_names
        ratios = np.divide(there.model.parameters, here.model.parameters)
        assert np.isin(np.frexp(ratios)[0], 0.5).all()
        for part in ("estimation", "validation"):
            errors = (each.metrics[part]["free_run"].rmse for each in (here, there))
            assert np.ldexp(next(errors), units[2]) == next(errors)
