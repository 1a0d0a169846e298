"""HTML report of an identification: order, parameters, other models."""

import pytest

import islands
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.pages.identification import identification_report, list_terms
from islands.report.pages.origin import Origin
from support.identifications import record

FIGURES = {
    f"{name}.svg": f"<svg>{name}</svg>".encode() for name in ("free-run", "residuals", "loop", "front")
}


@pytest.fixture(scope="module")
def found():
    data = record(300)
    named = Dataset(data.u, data.y, 0.01, ("u_V",), "y_um", ("V",), "um")
    settings = {
        "library": "polynomial",
        "degree": 1,
        "lags": 1,
        "max_terms": 2,
        "certificate": 0,
        "average": 1,
    }
    return islands.fit(named, estimator="shooting", **settings)


def write(found, figures=FIGURES, **changes):
    document = result_document(found.search_result) | changes
    return identification_report(
        Origin("job"), document, found.best.model.equation().mathml, figures
    ).decode()


@pytest.mark.ci
def test_names_of_columns_are_text(found):
    document = result_document(found.search_result)
    names = {"inputs": ["<u>"], "output": "<script>"}
    page = write(found, record={**document["record"], "names": names})
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_diverged_free_run_has_no_number(found):
    document = result_document(found.search_result)
    (entry, *_) = document["models"]
    lost = dict.fromkeys(entry["metrics"]["validation"]["free_run"])
    validation = {**entry["metrics"]["validation"], "free_run": lost}
    outcomes = {
        **entry["outcomes"],
        "validation": {**entry["outcomes"]["validation"], "free_run": "diverged"},
    }
    changed = {**entry, "metrics": {**entry["metrics"], "validation": validation}, "outcomes": outcomes}
    page = write(found, models=[changed], recommended={"rank": 1, "reasons": []})
    assert "diverges on the validation data" in page
    assert '<th scope="row">free run, validation data</th><td>diverged</td>' in page


def term(parameter, error, inclusion=None):
    return {"term": "y(k-1)", "parameter": parameter, "standard_error": error, "inclusion": inclusion}


def cells(*terms):
    """Return the values of the first row by heading."""
    headings, rows = list_terms(terms)
    return dict(zip(headings, rows[0], strict=True))


def test_interval_reaches_1_96_standard_errors_from_the_estimate():
    assert cells(term(2.0, 0.5, 0.875)) == {
        "term": "y(k-1)",
        "parameter": "2",
        "standard error": "0.5",
        "95 % interval": "1.02 to 2.98",
        "inclusion": "0.88",
    }


def test_parameter_that_the_constraints_determine_is_fixed_and_has_no_interval():
    found = cells(term(1.0, 0.0), term(1.0, 0.1))
    assert (found["standard error"], found["95 % interval"]) == ("fixed", "-")


def test_parameters_with_names_have_values():
    headings, _ = list_terms([term(1.0, None)], named=True)
    assert headings == ("parameter", "value")
