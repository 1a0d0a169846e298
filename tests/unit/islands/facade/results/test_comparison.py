"""Comparison of two results."""

import numpy as np
import pytest

import islands
from support.searches import record

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def small():
    return islands.fit(record(200), library="polynomial", degree=1, max_terms=1, estimator="shooting")


def test_a_comparison_has_one_row_per_result(result, small):
    compared = result.compare(small, names=("large", "small"))
    assert [row.result for row in compared.recommended] == ["large", "small"]
    assert [row.terms for row in compared.recommended] == [each.best.model.size for each in (result, small)]
    errors = [each.best.metrics["validation"]["free_run"].rmse for each in (result, small)]
    assert [row.rmse for row in compared.recommended] == errors
    assert str(compared).splitlines()[0] == "Errors in free run on the validation data"
    assert repr(compared).count("\n") == 3


def test_a_comparison_on_a_record_simulates_it(result, small):
    data = record(300, seed=3)
    compared = result.compare(small, data)
    for row, each in zip(compared.recommended, (result, small), strict=True):
        error = (data.y - each.best.simulate(data).y)[each.best.warm_up :]
        assert row.rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)


def test_errors_on_different_validation_data_are_marked(result):
    other = islands.fit(record(400), validation=0.5, library="polynomial", degree=1, max_terms=1)
    assert "differ: give a record" in result.compare(other).data


def test_the_figure_draws_every_model_of_both_results(result, small):
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    compared = result.compare(small)
    assert compared.plot(ax=axes) is axes.get_figure()
    assert len(axes.get_lines()[0].get_xdata()) == len(result.models)
    assert len(compared.plot().axes) == 1


def test_names_of_results_differ(result, small):
    with pytest.raises(islands.SettingsError, match="two different names"):
        result.compare(small, names=("fit", "fit"))
