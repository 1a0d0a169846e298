"""`islands.fit` on several recordings, and on records with missing outputs."""

import numpy as np
import pytest

import islands
from islands.errors import RecordError
from islands.expressions.printing import plain
from islands.records.dataset import Dataset, join

TANK = {"y(k-1)": 0.6, "u(k-1)": 0.5, "u(k-1)^2": -0.2}


def tank(samples=400, seed=0, size=1.0):
    """Return a record of y(k) = 0.6 y(k-1) + 0.5 u(k-1) - 0.2 u(k-1)^2 + e(k)."""
    rng = np.random.default_rng(seed)
    u, y = size * rng.uniform(-1, 1, samples), np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.6 * y[k - 1] + 0.5 * u[k - 1] - 0.2 * u[k - 1] ** 2 + 0.01 * rng.normal()
    return Dataset(u, y, 1.0)


def check_law(made):
    """Check that the model of three terms is the law of `tank`."""
    model = {m.model.size: m.model for m in made.models}[3]
    terms = {plain(item.expression): theta for item, theta in zip(model.regressors, model.theta, strict=True)}
    assert terms == {name: pytest.approx(theta, abs=0.02) for name, theta in TANK.items()}


def test_several_recordings_are_fitted_together():
    parts = tuple(tank(samples, seed) for seed, samples in enumerate((100, 3, 160, 2, 140)))
    made = islands.fit(join(parts), library="polynomial", max_terms=4, estimator="shooting")
    assert made.search_result.record.segments == (100, 3, 160, 2, 140)
    assert made.search_result.split.estimation.segments == (75, 2, 120, 2, 105)
    assert list(made.search_result.recommended.recordings["validation"]) == ["1", "2", "3", "5"]
    # Each recording has a warm-up of three samples.
    assert made.search_result.search.full_set["bytes"] == 8 * 84 * (72 + 117 + 102)
    check_law(made)


@pytest.mark.ci
def test_a_law_is_found_in_a_record_with_missing_outputs():
    y = tank().y.copy()
    y[[3, 50, 51, 52, 120, 200, 350, 361]] = np.nan
    made = islands.fit(Dataset(tank().u, y, 1.0), library="polynomial", max_terms=4)
    check_law(made)
    assert "Missing outputs: 8 of 400 samples are skipped" in " ".join(str(made).split())


def test_a_record_without_any_output_raises_record_error():
    with pytest.raises(RecordError, match="is missing in every sample: choose another output"):
        islands.fit(Dataset(tank().u, np.full(400, np.nan), 1.0))
