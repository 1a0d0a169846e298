"""Which figures a model has."""

import pytest

from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.report.figures.availability import list_model_figures
from islands.report.figures.names import LATENT_FIGURES, MODEL_FIGURES
from support.latent_systems import SPRING
from support.latent_systems import make_model as make_latent

NARX = make_model([(parse("y(k-1)"), 0.9), (parse("u(k-1)"), 0.3)], ("u",))
LINEAR = make_latent({name: value for name, value in SPRING.items() if name[0] not in "ew"}, ())
STATIC = [
    make_model([(parse("u(k-1)^2"), 0.9)], ("u+1",)),
    make_latent({"f1": 1.0, "v1": 2.0}, ("tanh",), 0, input_names=("u+1",)),
]


def find_absent(model, *, has_loop=True):
    return set(MODEL_FIGURES) - set(list_model_figures(model, has_loop))


def test_a_latent_model_has_figures_that_others_lack():
    assert set(list_model_figures(make_latent(), True)) - set(list_model_figures(NARX, True)) == set(
        LATENT_FIGURES
    )


def test_a_model_without_units_has_no_curves():
    assert find_absent(LINEAR) == {"static-curve", "curves"}


def test_a_record_without_a_loop_has_no_loop_figure():
    assert find_absent(make_latent(), has_loop=False) == {"static-curve", "loop"}


@pytest.mark.parametrize("model", STATIC)
def test_a_static_model_has_a_curve_in_place_of_what_states_have(model):
    assert find_absent(model) == {*LATENT_FIGURES, "loop", "hold"}
