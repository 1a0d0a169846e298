"""Choice of the preset auto: its documents."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.errors import SettingsError
from islands.facade.automatic.choice import Choice, choice_from_document, keep_models
from islands.records.dataset import Dataset


@pytest.fixture(scope="module")
def found():
    """Return a search result with equations and a linear state space."""
    rng = np.random.default_rng(0)
    u = rng.uniform(-1.0, 1.0, 240)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 1e-3 * rng.standard_normal(240)
    options = {"library": "polynomial", "degree": 1, "lags": 2, "max_terms": 3, "certificate": 0}
    return islands.fit(Dataset(u, y, 0.1), **options).search_result


def test_a_checkpoint_keeps_the_models_bit_for_bit(found):
    data = {"average": 1, "early": []}
    choice = Choice("smooth", (2,), ("a", "b"), {"smooth": 0.1}, {}, data, keep_models(found.models))
    text = json.dumps(choice.to_checkpoint())
    restored = choice_from_document(json.loads(text))
    assert restored == choice
    again = restored.assess_models(found.split, found.shooting_interval, "none")
    assert [each.metrics for each in again] == [each.metrics for each in found.models]
    assert "models" not in choice.to_document()


def test_damaged_choice_is_refused():
    with pytest.raises(SettingsError, match="start a new run"):
        choice_from_document({"kind": "smooth"})
