"""Cells of the parameters of a model."""

from islands.reports.term_table import list_terms


def term(parameter, error, inclusion=None):
    return {"term": "y(k-1)", "parameter": parameter, "standard_error": error, "inclusion": inclusion}


def test_interval_reaches_1_96_standard_errors_from_the_estimate():
    assert list_terms([term(2.0, 0.5, 0.875)]) == [("y(k-1)", "2", "0.5", "1.02 to 2.98", "0.88")]


def test_parameter_that_the_constraints_determine_is_fixed_and_has_no_interval():
    assert list_terms([term(1.0, 0.0)]) == [("y(k-1)", "1", "fixed", "-", "-")]


def test_unknown_standard_error_gives_no_interval():
    assert list_terms([term(1.0, None)]) == [("y(k-1)", "1", "-", "-", "-")]
