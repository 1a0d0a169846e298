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
    assert sentences[6].startswith("    y1(k) = ")
    verdict = said(document)["As a simulation"]
    assert verdict.startswith("As a simulation: good (y1: ")
    assert "; y2: " in verdict
    assert said(document)["Fails at"] == "Fails at: none of the checks."
    text = " ".join(str(found).split())
    assert all(" ".join(each.split()) in text for each in (sentences[0], *sentences[3:5], *sentences[7:]))


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
