"""Published models: what the printed digits permit, and what least squares gives."""

import pytest

from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.reproduction.published import (
    assess_published,
    count_different,
    estimate_again,
    explain_error,
    explain_parameter,
    half_digit,
)
from islands.systems.bouc_wen import authors_estimation, authors_validation
from islands.systems.published_models import PUBLISHED


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


def document(printed, estimated, half, error, mape=0.3):
    row = {"printed": printed, "estimated": estimated, "half_digit": half, "standard_error": error}
    rounding = {"estimation": {"mape": [0.29, 0.31]}}
    return {"parameters": [row], "estimated": {"estimation": {"mape": mape}}, "rounding": rounding}


@pytest.mark.parametrize(
    ("estimated", "error", "sentence"),
    [
        (1.004, 0.0001, "Equal to the printed digits."),
        (1.010, 0.0100, "1 standard errors apart: the record does not determine"),
        (1.100, 0.0100, "10 standard errors apart: the printed value is not that of least squares"),
    ],
)
def test_reason_of_a_parameter_follows_from_its_standard_error(estimated, error, sentence):
    row = document(1.0, estimated, 0.005, error)["parameters"][0]
    assert explain_parameter(row).startswith(sentence)


@pytest.mark.parametrize(
    ("published", "mape", "parts"),
    [
        (0.300, 0.301, ["equal within 0.33 %", "includes the published"]),
        (0.300, 0.270, ["smaller by 10 %", "includes the published"]),
        (0.300, 0.900, ["larger by a factor of 3"]),
        (0.350, 0.350, ["equal within 0 %", "does not include the published"]),
        (0.350, None, ["diverges"]),
    ],
)
def test_reason_of_an_error_follows_from_the_numbers(published, mape, parts):
    found = explain_error(published, document(1.0, 1.0, 0.005, 0.01, mape), "estimation", "mape")
    assert all(part in found for part in parts), found


def test_different_parameters_are_named_as_a_reason():
    found = explain_error(0.3, document(1.0, 2.0, 0.005, 0.01, 0.2), "estimation", "mape")
    assert "1 printed parameters are not those of least squares" in found


def test_structure_that_the_record_does_not_excite_is_refused():
    still = Dataset([0.0] * 50, [float(k % 2) for k in range(50)], 1e-3, ("u_V",), "y_um")
    with pytest.raises(RecordError, match="cannot be estimated"):
        estimate_again(PUBLISHED["13"], still)
