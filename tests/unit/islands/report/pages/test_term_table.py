"""Table of the parameters of a model."""

from islands.report.pages.term_table import list_terms


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
