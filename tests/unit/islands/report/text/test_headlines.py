"""Headlines: one sentence with the error in per cent."""

from typing import Any

import pytest

from islands.report.text.headlines import write_coupled_headline, write_diagnosis_headline, write_headline

FREE = {"rmse": 0.25, "mape": 1.234, "r2": 0.9}
LOST = dict.fromkeys(FREE)
CONSTANT = {"rmse": 0.25, "mape": None, "r2": None}


def result(error: dict[str, Any], size: int = 2, **entry: Any) -> dict[str, Any]:
    metrics = {"validation": {"free_run": error, "one_step_ahead": FREE}}
    empty = {"physics": {}, "residual_tests": {}, "bands": None, "refit": None}
    model = {"size": size, "metrics": metrics, **empty, **entry}
    record = {"names": {"output": "y_um", "inputs": ["u_V"]}, "units": {"output": "um", "inputs": ["V"]}}
    return {"record": record, "models": [model], "recommended": {"rank": 1, "reasons": []}, "data": {}}


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        (result(FREE), "A model of 2 terms simulates y_um with a mean absolute error of 1.23 % of its range"),
        (
            result(FREE, 1),
            "A model of 1 term simulates y_um with a mean absolute error of 1.23 % of its range",
        ),
        (
            result(FREE, 3, kind="linear"),
            "A model of 3 parameters simulates y_um with a mean absolute error of 1.23 % of its range",
        ),
        (result(CONSTANT), "A model of 2 terms simulates y_um with a free-run error (RMSE) of 0.25 um"),
        (result(LOST), "The free run of a model of 2 terms diverges on the validation data of y_um"),
    ],
)
def test_headline_states_size_output_and_error_of_the_free_run(document, expected):
    assert write_headline(document) == expected


def output(name: str, error: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "unit": "m", "metrics": {"validation": {"free_run": error}}}


def test_headline_of_several_outputs_states_every_error():
    stated = write_coupled_headline([output("a", FREE), output("b", {**FREE, "mape": 0.5})])
    assert stated == (
        "The model of 2 outputs simulates a with a mean absolute error of 1.23 % of its range and b with a "
        "mean absolute error of 0.5 % of its range"
    )
    assert "diverges" in write_coupled_headline([output("a", FREE), output("b", LOST)])


def diagnosis(verdict: str = "named", **changes: Any) -> dict[str, Any]:
    gain = {"before": {"rmse": 2.0, "mape": 5.05}, "after": {"rmse": 0.5, "mape": 1.2}}
    found = {"verdict": verdict, "gain": gain, "noise_floor_rmse": 0.1, "held_out_part": "the last quarter"}
    found["record"] = {"units": {"output": "um"}}
    return {**found, "output_std": 4.0, "calibrated_rmse": 1.0, **changes}


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        (
            diagnosis(),
            (
                "RMSE on the last quarter: 2 um without the effects, 0.5 um with them, 12 % of the standard "
                "deviation of the output."
            ),
        ),
        (
            diagnosis("unknown", gain=None),
            "Error on the last quarter: 25 % of the standard deviation of the output.",
        ),
        (diagnosis("unknown", gain=None, output_std=None), ""),
        (
            diagnosis("gross error", record_findings=[{"errors": {"before": 0.5, "after": 0.02}}]),
            (
                "Error: 50 % of the standard deviation of the output with the record as given, 2 % with the "
                "record corrected."
            ),
        ),
        (diagnosis("gross error", record_findings=[{"errors": None}]), ""),
    ],
)
def test_diagnosis_headline_states_the_errors(document, expected):
    assert write_diagnosis_headline(document) == expected
