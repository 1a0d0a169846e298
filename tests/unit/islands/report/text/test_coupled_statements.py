"""Statements about a result of several outputs: one verdict, from the common free run of all outputs."""

from copy import deepcopy

import pytest

import islands
from islands.report.text.coupled_statements import describe_coupled
from support.coupled_systems import TWO_MASSES, make_coupled_record


@pytest.fixture(scope="module")
def found():
    data = make_coupled_record(TWO_MASSES, samples=400, noise=0.01)
    return islands.fit_coupled(data, library="polynomial", degree=1, max_terms=4, certificate=0, average=1)


@pytest.fixture
def document(found):
    return deepcopy(found.document())


def said(document):
    """Return the sentences by first word."""
    return {line.partition(":")[0]: line for line in describe_coupled(document)}


def test_the_summary_and_the_sentences_have_the_verdict_of_the_common_free_run(found, document):
    sentences = describe_coupled(document)
    assert found.sentences() == sentences
    assert "y1(k) = " in sentences[1]
    verdict = said(document)["As a simulation"]
    assert verdict.startswith("As a simulation: good (y1: ")
    assert "; y2: " in verdict
    assert said(document)["Fails at"] == "Fails at: none of the checks."
    text = " ".join(str(found).split())
    assert all(" ".join(each.split()) in text for each in sentences[4:])


def test_one_output_that_fails_is_a_limit_of_the_model(document):
    second = document["outputs"][1]
    second["residual"] |= {"verdict": "inadequate", "predictable_percent": 5.0}
    second["residual"]["predictable_share"]["free_run"] = 0.94
    found = said(document)
    assert found["As a simulation"].startswith("As a simulation: usable, with limits (")
    assert "94 % of the residual of y2 is predictable (RMS 5 % of the output range)" in found["Fails at"]
    assert "no structure is left in the residual of y1" in found["Good for"]
    assert "within the limits below" in found["Good for"]
    assert "in the equations of y2" in found["Next"]


def test_a_common_free_run_that_diverges_is_unsuitable(document):
    for output in document["outputs"]:
        output["metrics"]["validation"]["free_run"] = dict.fromkeys(("mape", "r2", "rmse", "fit_percent"))
        output["bands"] = None
        output["residual"] |= {"verdict": "inadequate", "predictable_percent": None}
        output["residual"]["predictable_share"]["free_run"] = None
    found = said(document)
    assert found["y1"] == "y1: the common free run on the validation data diverges."
    assert found["As a simulation"].startswith("As a simulation: unsuitable")
    assert found["Fails at"] == "Fails at: simulation from the inputs alone: the free run diverges."
    assert found["Good for"] == "Good for: prediction one step ahead."


def test_an_extrapolating_validation_and_a_growing_error_are_failures(document):
    document["inputs"]["validation"] = [[-3.0, 3.0]]
    first = document["outputs"][0]["metrics"]
    first["estimation"]["free_run"]["rmse"] = first["validation"]["free_run"]["rmse"] / 4
    found = said(document)
    assert "extrapolation: u is -3 to 3 in the validation data" in found["Fails at"]
    assert "y1: the free-run error on the validation data is 4 times that on" in found["Fails at"]
    assert "estimate from a record that covers" in found["Next"]


def test_a_band_that_misses_the_validation_data_and_a_poor_output_are_failures(document):
    document["outputs"][0]["bands"] |= {"coverage": 0.5, "independent_samples": 7.0}
    document["outputs"][0]["bands"]["width"] = 10.0 * document["outputs"][0]["data"]["output_range"]
    document["outputs"][1]["metrics"]["validation"]["free_run"]["r2"] = 0.3
    found = said(document)
    assert "the 90 % prediction band of y1 contains 50 % of the validation samples" in found["Fails at"]
    assert "y1: the 90 % prediction band is wider than the output range" in found["Fails at"]
    assert "simulation from the inputs alone: R2 0.300 of y2" in found["Fails at"]
    assert found["As a simulation"].startswith("As a simulation: unsuitable")
    assert "about 7 independent samples, so that the RMSE on new data may be 1.8" in found["As a simulation"]
