"""Result of a search: the recommended model and the folder."""

import json

import pytest

import islands
from support.searches import record
from support.undrawn import undrawn_figures


@pytest.fixture(scope="module")
def result():
    return islands.fit(record(400), library="polynomial", degree=1, max_terms=4)


def test_the_best_model_is_the_recommended_one(result):
    assert result.best.rank == result.recommendation.rank
    assert result.best.model == result.search_result.recommended.model
    least = result.models[0].metrics["validation"]["free_run"].rmse
    assert all(model.metrics["validation"]["free_run"].rmse >= least for model in result.models)


def test_a_result_without_a_loop_replaces_the_loop_figure_of_an_earlier_one(result, tmp_path):
    figures = tmp_path / "figures"
    figures.mkdir()
    (figures / "loop.svg").touch()
    with undrawn_figures():
        result.save(tmp_path)
    assert "loop.svg" not in {path.name for path in figures.iterdir()}
    assert json.loads((tmp_path / "result.json").read_text())["loop"] is False
