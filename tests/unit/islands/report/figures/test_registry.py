"""Figures of the registry agree with the metrics of the model."""

import re
from dataclasses import replace
from math import nan

import pytest

from islands.errors import SettingsError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.split import Split
from islands.report.figures import names
from islands.report.figures.model_responses import draw_responses
from islands.report.figures.registry import FIGURES, SEARCH_FIGURES
from islands.validation.assessment import assess
from support.assessments import with_changes
from support.searches import record

#: The initial state decays slowly, so the error of the free run depends on where the run begins.
MODEL = make_model([(parse("y(k-1)"), 0.999), (parse("u(k-1)"), 0.3)], ("u",))


@pytest.mark.ci
def test_the_figure_of_the_residual_gives_its_predictable_part_before_the_tests():
    split = Split(record(400), record(300, seed=1))
    entry = assess(MODEL, split, 50)
    structure = replace(entry.residual_structure, one_step_share=0.04, free_run_share=0.314)
    for shares, words in (
        (structure, "predictable part of the residual: 4 % one step ahead, 31 % in free run"),
        (replace(structure, free_run_share=nan), "predictable part of the residual: 4 % one step ahead"),
    ):
        assessed = with_changes(entry, residual_structure=shares)
        parts, tests = FIGURES["residuals"](assessed, split).get_suptitle().split("\n")
        assert parts == words
        assert tests.startswith("residual tests ")


@pytest.mark.ci
@pytest.mark.parametrize("warm_up", [None, 60])
def test_free_run_figure_has_the_error_of_the_assessment(warm_up):
    split = Split(record(400), record(300, seed=1))
    assessed = assess(MODEL, split, 50, warm_up)
    figure = FIGURES["free-run"](assessed, split)
    texts = [text.get_text() for text in figure.findobj(match=lambda artist: hasattr(artist, "get_text"))]
    (drawn,) = re.findall(r"RMSE ([0-9.e-]+)", " ".join(texts))
    assert float(drawn) == pytest.approx(assessed.metrics["validation"]["free_run"].rmse, rel=5e-3)


def test_the_names_of_the_figures_are_those_that_can_be_drawn():
    """Commands and the service know the names without loading matplotlib."""
    assert tuple(FIGURES) == names.MODEL_FIGURES
    assert tuple(SEARCH_FIGURES) == names.SEARCH_FIGURES
    assert tuple(draw_responses(MODEL, record(400))) == names.RESPONSES


def test_figures_are_named_in_a_list_or_all_at_once():
    assert names.parse_figures("loop, free-run,loop") == ("loop", "free-run")
    assert (names.parse_figures("all"), names.parse_figures("none")) == (names.ALL_FIGURES, ())
    with pytest.raises(
        SettingsError, match=r"no figure 'lop': take one or several of free-run, static-curve, .*none"
    ):
        names.parse_figures("free-run,lop")
