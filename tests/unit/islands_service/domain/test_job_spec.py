"""Specifications of jobs: unusable ones are refused before anything is built."""

import time
from dataclasses import asdict, fields

import pytest
from pydantic import ValidationError

from islands.errors import SettingsError
from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands_api.schemas import JobRequest
from islands_service.domain.job_spec import Identification
from islands_service.domain.search_limits import LIMITS, resolve_job_settings
from support.service import spec

DATASET = "0" * 32 + "-csv"


def order(**changes):
    return Identification.model_validate(spec(DATASET, **changes))


def refused(settings, **changes):
    """Return the error message for settings that can be parsed but not run, within a time limit."""
    began = time.perf_counter()
    with pytest.raises(SettingsError) as error:
        resolve_job_settings(order(settings=settings, **changes), 256, 10**10)
    assert time.perf_counter() - began < 20.0
    return str(error.value)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_setting_of_a_preset_can_be_given(preset):
    given = asdict(PRESETS[preset])
    assert resolve_job_settings(order(preset=preset, settings=given), 256, 10**10) == (PRESETS[preset],)


def test_constraints_of_a_job_are_statements_about_its_inputs():
    text = "odd; gain = 2.5; [u(k-1)] >= 0"
    assert resolve_job_settings(order(settings={"constraints": text}), 256, 10**10)[0].constraints == text
    assert "unknown constraints 'gain = x'" in refused({"constraints": "gain = x"})
    assert "the record has 1: correct one of them" in refused({"constraints": "[u2(k-1)] = 0"})


def test_every_limit_belongs_to_a_setting():
    assert LIMITS.keys() <= {each.name for each in fields(Settings)}


@pytest.mark.parametrize("name", LIMITS)
def test_value_above_a_limit_is_refused(name):
    most = LIMITS[name]
    assert refused({name: most + 1}) == f"{name} is at most {most} on this service, got {most + 1}"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"islands": 10**6}, "islands is an integer from 1 to 10000"),
        ({"islands": 257}, "islands is at most 256 on this service"),
        ({"islands": -1}, "islands is an integer from 1 to 10000"),
        ({"topology": "0>1," * 250_000}, "topology has 1000000 characters, and 20000 is the most"),
        (
            {"islands": 2, "topology": ",".join(["0>1"] * 4000) + ",0>9"},
            "0>9 does not join two of the islands",
        ),
        ({"topology": "random-regular:99", "islands": 50}, "takes more than 99 islands"),
        ({"migrate_every": "5," * 9_999 + "1"}, "cannot read migrate_every"),
        ({"migrate_every": "5," * 10_001}, "migrate_every has 20002 characters"),
        ({"migrants": 10**30}, "cannot read migrants"),
        ({"shifts": [10**9]}, "back-shifts are at most 1000 on this service"),
        ({"shifts": [0]}, "shifts is a list of integers of at least 1, got [0]"),
        ({"shifts": list(range(1, 66))}, "shifts has 65 entries, and 64 is the most"),
        ({"primitives": ["mul"] * 10_000}, "primitives has 10000 entries"),
        ({"characters": ["explorer"] * 65}, "characters has 65 entries"),
        ({"library_degree": 50}, "library_degree is at most 8"),
        (
            {"library": "polynomial", "library_degree": 8, "library_lags": 30, "max_height": 12},
            "candidates are more than a library may have (4000)",
        ),
        ({"library": "phi-polynomial", "library_lags": 1}, "lags of at least 2"),
        ({"library": "polynomial", "library_degree": 0}, "degree and lags are at least 1"),
        ({"library": "no such"}, "library is one of phi-polynomial"),
        ({"elite": 1.5}, "elite is a number from 0 to 1, got 1.5"),
        ({"tolerance": -1e-3}, "tolerance is a number of at least 0"),
        ({"target_error": -1.0}, "target_error is a number of at least 0"),
        ({"initial_terms": [3, 2]}, "initial_terms (3, 2) lie between 1 and max_terms"),
        ({"shifts": [], "primitives": []}, "give at least one of them"),
        (
            {"population": 100_000, "generations": 10**6},
            "1e+11 individuals, and this service evaluates at most",
        ),
    ],
)
def test_settings_that_exhaust_memory_or_time_are_refused_at_once(settings, words):
    assert words in refused(settings)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dt": 0}, "greater than 0"),
        ({"dt": -0.1}, "greater than 0"),
        ({"dt": float("inf")}, "finite number"),
        ({"dt": float("nan")}, "finite number"),
        ({"validation": 1.5}, "less than 1"),
        ({"validation": 1}, "less than 1"),
        ({"validation": float("nan")}, "finite number"),
        ({"validation": {"dataset": DATASET, "rows": "x"}}, "cannot read the rows 'x'"),
        ({"validation": {"dataset": "../../etc"}}, "should match pattern"),
        ({"validation": {}}, "Field required"),
        ({"rows": "a:b"}, "cannot read the rows 'a:b': write START:STOP, for example 0:5000"),
        ({"rows": "5"}, "cannot read the rows"),
        ({"rows": "1:2:3"}, "cannot read the rows"),
        ({"rows": ""}, "cannot read the rows"),
        ({"rows": "0:5\n"}, "cannot read the rows"),
        ({"rows": "٣:"}, "cannot read the rows"),
        ({"rows": ":٩"}, "cannot read the rows"),
        ({"rows": "0:" + "9" * 13}, "cannot read the rows"),
        ({"inputs": []}, "at least 1 item"),
        ({"inputs": ["u"] * 17}, "at most 16 items"),
        ({"inputs": "u_V"}, "valid tuple"),
        ({"inputs": [""]}, "at least 1 character"),
        ({"inputs": ["u" * 201]}, "at most 200 characters"),
        ({"inputs": [7]}, "valid string"),
        ({"output": None}, "valid string"),
        ({"dataset": "a\0b"}, "should match pattern"),
        ({"dataset": ""}, "should match pattern"),
        ({"dataset": "a" * 49}, "should match pattern"),
        ({"seed": -1}, "greater than or equal to 0"),
        ({"seed": 2**63}, "less than 9223372036854775808"),
        ({"seed": 0.5}, "fractional part"),
        ({"settings": {"tolerance": float("inf")}}, "finite number"),
        ({"settings": {"target_error": float("nan")}}, "finite number"),
        ({"settings": {"generations": 0.5}}, "fractional part"),
        ({"settings": {"generations": "many"}}, "valid integer"),
        ({"settings": {"__class__": 1}}, "not permitted"),
        ({"settings": []}, "valid dictionary"),
    ],
)
def test_invalid_field_is_refused(changes, words):
    with pytest.raises(ValidationError, match=words.replace("(", r"\(").replace("?", r"\?")):
        order(**changes)


@pytest.mark.parametrize("seed", [0, 2**63 - 1])
def test_every_seed_of_63_bits_is_kept_exactly(seed):
    assert order(seed=seed).seed == seed


def test_specification_contains_only_the_given_fields():
    request = JobRequest.model_validate(spec(DATASET, name="n", priority=3, settings={"islands": 2}))
    assert request.spec == spec(DATASET, settings={"islands": 2})
