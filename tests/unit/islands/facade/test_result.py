"""Result of a search: the recommended model and the folder."""

import json
import re
from base64 import b64decode

import pytest

import islands
from islands.model.equations import mathml_equation
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


def test_results_models_and_records_are_represented_in_one_line(result):
    text = repr(result)
    assert text == f"<Result of {len(result.models)} models, recommended: {result.best.equation}>"
    assert repr(result.models[1]) == f"<FittedModel of rank 2: {result.models[1].equation}>"
    assert repr(record(400)) == "<Dataset of 400 samples of 0.04 s: u to y>"


def test_a_notebook_shows_the_equation_the_sentences_and_a_figure(result):
    shown = result._repr_html_()
    assert mathml_equation(result.best.model) in shown
    assert "<p>Recommended: model " in shown
    assert "<p>Next: " in shown
    image = re.search(r'src="data:image/svg\+xml;base64,([^"]+)"', shown)
    assert b"</svg>" in b64decode(image[1])
    rmse = result.models[1].metrics["validation"]["free_run"].rmse
    assert f"<p>Rank 2: free-run RMSE on the validation data {rmse:.4g}</p>" in result.models[1]._repr_html_()
