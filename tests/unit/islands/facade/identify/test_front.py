"""The models of a choice compete with those of the search."""

import json

import numpy as np
import pytest

from islands.facade.automatic.choice import choice_from_document
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.identify import identify_record
from islands.records.dataset import Dataset

SHORT = {"population": 20, "generations": 1, "migrate_every": 1}


def make_tank(samples=500):
    """Return a record of a tank whose outflow is the root of its level."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(0.5, 1.5, samples // 20), 20)
    y = np.ones(samples)
    for k in range(1, samples):
        y[k] = y[k - 1] + 0.1 * u[k - 1] - 0.1 * np.sqrt(y[k - 1])
    return Dataset(u, y + 0.002 * rng.standard_normal(samples), 1.0)


@pytest.mark.ci
def test_a_search_is_not_worse_than_the_front_of_its_choice_which_a_checkpoint_keeps():
    record = make_tank()
    choice = choose_preset(record, 0.25, SHORT)
    found = identify_record(record, preset=choice, **SHORT).search_result
    front = choice.assess_models(found.split, found.shooting_interval, "none")
    best = min(each.mean_square for each in front)
    assert min(each.mean_square for each in found.models) <= best
    assert {each.model.kind for each in found.models} >= {each.model.kind for each in front}
    restored = choice_from_document(json.loads(json.dumps(choice.to_checkpoint())))
    again = identify_record(record, preset=restored, **SHORT).search_result
    assert [each.model for each in again.models] == [each.model for each in found.models]
    assert again.recommendation == found.recommendation


@pytest.mark.ci
def test_settings_that_say_what_a_model_is_hold_for_all_models():
    """The fits of the choice do not know them."""
    choice = choose_preset(make_tank(), 0.25, {**SHORT, "primitives": ("mul",)})
    assert choice.models == ()
