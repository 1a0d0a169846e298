"""Constraints of latent models: they hold in every model of a result, which states them."""

import pytest

import islands
from islands.errors import SettingsError
from islands.facade.identify import identify_record
from support.latent_systems import spring_record

#: A search that takes a second.
SHORT = {"population": 8, "generations": 2, "migrate_every": 2, "islands": 2}

#: What is known about the spring.
KNOWN = "fixed-point = 0, 0.3; gain = 0.564 at 0, 0.3"


def identify(record, **changes):
    return identify_record(record, preset="latent", **{**SHORT, **changes})


@pytest.fixture(scope="module")
def result():
    return identify(spring_record(300, noise=0.05), constraints=KNOWN, refit="all")


@pytest.mark.ci
def test_every_model_meets_the_constraints_before_and_after_a_refit(result):
    assert len(result.models) > 1
    assert any(each.is_refitted for each in result.models)
    for each in result.models:
        for checks in (each.assessment.constraints, each.constraints):
            assert [check.text for check in checks] == KNOWN.split("; ")
            assert all(check.met for check in checks)
            assert [check.value for check in checks] == pytest.approx([0.3, 0.564], rel=1e-9)


@pytest.mark.nightly
def test_models_that_cannot_meet_the_constraints_are_left_out_and_counted():
    # The slopes of a linear model are equal.
    text = "gain = 0.564 at 0, 0.3; gain = 0.4 at 1, 0.75"
    found = identify(spring_record(300, noise=0.02), constraints=text, generations=1, islands=1)
    assert all(each.model.units for each in found.models)
    assert all(check.met for each in found.models for check in each.constraints)
    assert found.search_result.search.outcomes["infeasible"] >= 2


@pytest.mark.parametrize("text", ["[u(k-1)] = 0.5", "hysteresis", "even"])
def test_statements_that_make_no_sense_are_refused(text):
    record, message = spring_record(100), "Statements about latent models are gain, fixed-point and odd"
    with pytest.raises(SettingsError, match=message):
        islands.fit(record, model="latent", constraints=text)
    with pytest.raises(SettingsError, match=message):
        identify(record, constraints=text)


def test_a_statement_refers_to_inputs_of_the_record():
    with pytest.raises(SettingsError, match="2 inputs, but the record has 1"):
        identify(spring_record(100), constraints="gain(u2) = 1")
