"""Form of a model: what its output depends on."""

import pytest

from islands.expressions.parsing import parse
from islands.models.form import name_form
from islands.models.narx import Model, canonical_order
from islands.models.regressor import Regressor
from support.latent_systems import make_model


def equation(*terms, name="u+1"):
    regressors = canonical_order(Regressor(parse(term)) for term in terms)
    return Model(tuple(regressors), input_names=(name,))


def latent(order, *wiring, units=(), **changes):
    return make_model(dict.fromkeys(wiring, 0.5), units, order, input_names=("u+1",), **changes)


@pytest.mark.parametrize(
    ("model", "form"),
    [
        (equation("u(k-1)^2", "1"), "static"),
        (equation("u(k-1)", "1"), "static"),
        (equation("u(k-1)^2", name="u"), "equation"),
        (equation("u(k-1)*u(k-2)"), "equation"),
        (equation("y(k-1)", "u(k-1)^2"), "equation"),
        (equation("1"), "linear"),
        (latent(0, "f1", "v1", units=("tanh",)), "static"),
        (latent(0, "d", "level"), "static"),
        (latent(0, "d", "level", delays=(2,)), "linear"),
        (latent(0, "level"), "linear"),
        (latent(1, "a1_1", "b1", "c1", "d", "f1", "v1", units=("tanh",)), "curve"),
    ],
)
def test_a_model_is_static_if_its_output_depends_on_inputs_of_the_same_sample_only(model, form):
    assert name_form(model) == form
