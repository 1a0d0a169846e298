"""Published models: what the printed digits permit, and what least squares gives."""

import pytest

from islands.systems.bouc_wen import authors_estimation, authors_validation
from islands.systems.published_models import PUBLISHED
from lab.reproduction.published import (
    assess_published,
    count_different,
    half_digit,
)


@pytest.fixture(scope="module")
def assessed():
    estimation, validation = authors_estimation(), authors_validation()
    return assess_published(PUBLISHED["13"], {"estimation": estimation, "10s": validation[:10_000]}, 5)


def test_model_13_estimated_again_equals_table_1(assessed):
    """The validation of the paper is about ten seconds long, which its last digits depend on."""
    errors = assessed["estimated"]
    assert errors["estimation"]["mape"] == pytest.approx(0.31189, abs=1e-3)
    assert errors["10s"]["mape"] == pytest.approx(0.25250, abs=1e-3)
    assert [round(errors[record]["r2"], 4) for record in ("estimation", "10s")] == [0.9994, 0.9999]


def test_parameters_of_model_13_are_those_of_table_2(assessed):
    """They have the signs and the order of the paper, although the model is in canonical form."""
    assert [row["term"] for row in assessed["parameters"]] == list(PUBLISHED["13"].terms)
    assert count_different(assessed) == 0
    for row in assessed["parameters"]:
        assert row["estimated"] == pytest.approx(row["printed"], abs=max(1e-12, 2 * row["standard_error"]))


def test_range_of_the_rounding_includes_the_printed_error(assessed):
    for record, errors in assessed["printed"].items():
        low, high = assessed["rounding"][record]["mape"]
        assert low < errors["mape"] < high


@pytest.mark.parametrize(
    ("value", "half"),
    [(1.0, 0.0), (0.77, 5e-3), (1.44e-2, 5e-5), (-9.60e-3, 5e-6), (3.14, 5e-3), (13.8, 5e-2)],
)
def test_half_digit_is_that_of_the_printed_number(value, half):
    assert half_digit(value) == pytest.approx(half)
