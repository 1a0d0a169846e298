"""HTML report of a comparison: the best model, data, parameters, settings that differ."""

import re
from copy import deepcopy
from html import unescape

import pytest

import islands
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.pages.comparison import ComparedModel, comparison_report
from islands.report.pages.origin import Origin
from support.identifications import record
from support.undrawn import undrawn_figures

RUN = {"time_s": [0.0, 0.1, 0.2], "measured": [1.0, None, 3.0], "free_run": [1.1, 2.0, None]}


@pytest.fixture(scope="module")
def document():
    data = record(300)
    named = Dataset(data.u, data.y, 0.01, ("u_V",), "y_um", ("V",), "um")
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0}
    return result_document(islands.fit(named, average=1, estimator="shooting", **settings).search_result)


def compared(document, rank=1, name="first", run=RUN, **request):
    return ComparedModel(name, document, document["models"][rank - 1], run, {"output": "y_um", **request})


def write(*models):
    with undrawn_figures():
        return unescape(comparison_report(Origin("names"), models).decode()).replace("\u00a0", " ")


def headline(page):
    return re.search("<h1>(.*?)</h1>", page)[1]


@pytest.mark.ci
def test_models_of_different_data_have_separate_figures_and_no_best_one(document):
    other = {**RUN, "measured": [5.0, 6.0, 7.0]}
    page = write(compared(document), compared(document, name="second", run=other))
    assert headline(page) == "2 models of y_um."
    assert "different samples of the same data, so that their errors are not comparable" in page
    assert re.findall("<figcaption>(.*?)</figcaption>", page) == ["Free run of A", "Free run of B"]


def test_a_diverged_free_run_has_no_errors_and_is_never_the_best(document):
    lost = deepcopy(document)
    lost["models"][0]["metrics"]["validation"]["free_run"] = dict.fromkeys(("mape", "rmse", "r2"))
    assert "second simulates" in headline(write(compared(lost), compared(document, name="second")))
    assert "2 models of y_um diverge" in headline(write(compared(lost), compared(lost, name="second")))


def test_settings_that_differ_and_all_parameters_are_listed(document):
    first = compared(document, 1, seed=1, settings={"islands": 2})
    second = compared(document, 2, seed=1, settings={"islands": 4, "population": 50})
    page = write(first, second)
    settings = page[page.index("Settings that differ") :]
    rows = re.findall(r'<th scope="row">(.*?)</th><td>(.*?)</td><td>(.*?)</td>', settings)
    assert rows == [("islands", "2", "4"), ("population", "default", "50")]
    for each in (first, second):
        for term in each.model["terms"]:
            assert f'<th scope="row">{term["term"]}</th>' in page
            assert f"{term['parameter']:.5g}" in page
    assert "The jobs have the same settings." in write(
        first, compared(document, 2, seed=1, settings={"islands": 2})
    )


@pytest.mark.parametrize("count", [1, 7])
def test_a_comparison_has_two_to_six_models(document, count):
    with pytest.raises(SettingsError, match=f"2 to 6 models, {count} were given"):
        write(*[compared(document)] * count)
