"""Which figures a model has."""

from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.report.figures.availability import list_model_figures
from islands.report.figures.names import LATENT_FIGURES, MODEL_FIGURES
from support.latent_systems import SPRING
from support.latent_systems import make_model as make_latent

NARX = make_model([(parse("y(k-1)"), 0.9), (parse("u(k-1)"), 0.3)], ("u",))
LINEAR = make_latent({name: value for name, value in SPRING.items() if name[0] not in "ew"}, ())


def test_a_latent_model_has_figures_that_others_lack():
    assert list_model_figures(make_latent(), True) == MODEL_FIGURES
    for other in (NARX, None):
        assert set(MODEL_FIGURES) - set(list_model_figures(other, True)) == set(LATENT_FIGURES)


def test_a_model_without_units_has_no_curves():
    assert set(MODEL_FIGURES) - set(list_model_figures(LINEAR, True)) == {"curves"}


def test_a_record_without_a_loop_has_no_loop_figure():
    assert set(MODEL_FIGURES) - set(list_model_figures(make_latent(), False)) == {"loop"}
