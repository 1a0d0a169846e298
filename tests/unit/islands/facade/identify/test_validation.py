"""Arguments of `islands.identify`: validation data, presets, constraints, settings."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.evolution.presets import resolve_settings
from islands.records.dataset import Dataset
from islands.records.split import split
from support.identifications import BUDGET, identify, parameters, record

# Errors before the search starts.


@pytest.mark.ci
def test_validation_data_do_not_affect_the_search(data, result):
    """Only the selection and order of models may depend on them."""
    parts = split(data, 0.25)
    spoilt = replace(parts.validation, y=parts.validation.y[::-1].copy())
    other = identify(parts.estimation, validation=spoilt, **BUDGET, seed=5)
    assert other.search_result.search.history == result.search_result.search.history
    assert other.search_result.search.outcomes == result.search_result.search.outcomes
    assert parameters(other) != parameters(result)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"preset": "hystersis"}, "unknown preset 'hystersis': take one of auto, paper-case1"),
        ({"populatoin": 3}, "unknown setting 'populatoin': take one of population, effort, generations"),
        ({"population": 0}, "population is an integer of at least 1, got 0"),
        ({"generations": -1}, "generations is an integer of at least 0, got -1"),
        ({"max_terms": 0}, "max_terms is an integer of at least 1, got 0"),
        ({"max_height": -1}, "max_height is an integer of at least 0, got -1"),
        ({"shooting": 0}, "shooting is an integer of at least 1, got 0"),
        ({"primitives": ["mul", "gamma"]}, "unknown primitive 'gamma': take one of mul, sub"),
        ({"constraints": "physics"}, "unknown constraints 'physics': take one of none, hysteresis"),
        ({"islands": 0}, "islands is an integer from 1 to 10000, got 0"),
        ({"topology": "rong"}, "unknown topology 'rong': take one of isolated, ring"),
        ({"characters": ["plain", "lazy"]}, "unknown character 'lazy': take one of plain, explorer"),
        ({"migrate_every": "5,3:2,3:1"}, "its generations ascend, from 1 on"),
        ({"islands": 4, "migrants": 301}, "301 individuals would arrive on an island of 300"),
        ({"target_error": -1.0}, "target_error is a number of at least 0, got -1.0"),
        ({"seed": -1}, "a seed is not negative, got -1"),
        ({"validation": 1.5}, "the validation fraction lies between 0 and 1, got 1.5"),
    ],
)
def test_invalid_setting_raises_settings_error_with_its_name(data, changes, message):
    with pytest.raises(SettingsError, match=message):
        identify(data, on_epoch=pytest.fail, **changes)


def test_too_short_records_raise_an_error_before_the_search(data):
    with pytest.raises(RecordError, match="the validation data has 20 samples: lags up to"):
        identify(data, validation=record(seed=9)[:20], on_epoch=pytest.fail, **BUDGET)
    with pytest.raises(RecordError, match="the validation data has 25 samples"):
        identify(data[:100], on_epoch=pytest.fail, **BUDGET)
    with pytest.raises(RecordError, match="take a longer recording"):
        identify(data[:20], validation=record(seed=9), on_epoch=pytest.fail, **BUDGET)


def test_error_without_models_lists_the_outcomes():
    """The output grows by 5 % per sample, so the free run diverges on a longer record."""
    u = np.random.default_rng(0).normal(size=1000)
    growing = Dataset(u[:150], 1.05 ** np.arange(150.0), 0.1)
    with pytest.raises(SettingsError, match=r"no model was found: \{'ok': 1\}; take another preset, more"):
        identify(
            growing,
            validation=Dataset(u, np.sin(np.arange(1000.0)), 0.1),
            preset="narx",
            population=1,
            generations=0,
            max_terms=3,
            library_degree=1,
            library_lags=1,
            swap_search=False,
        )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"max_terms": 1}, {"initial_terms": (1, 1)}),
        ({"max_terms": 3}, {"initial_terms": (1, 3)}),
        ({"max_terms": 100}, {"initial_terms": (1, 10)}),
        ({"max_terms": 3, "initial_terms": (2, 2)}, {"initial_terms": (2, 2)}),
        ({"max_height": 1}, {"initial_height": 1}),
        ({"max_height": 0}, {"initial_height": 0}),
        ({"max_height": 9}, {"initial_height": 3}),
    ],
)
def test_initial_sizes_are_limited_by_the_maximum_sizes(changes, expected):
    made = asdict(resolve_settings("paper-case1", changes))
    assert {name: made[name] for name in expected} == expected
    assert {name: made[name] for name in changes} == changes
