"""Models: validation, properties and construction from terms."""

import pytest
from hypothesis import given

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.models.narx import Model, make_model
from islands.models.regressor import regressor
from support.strategies import models


def items(*texts):
    return tuple(regressor(parse(text))[1] for text in texts)


def terms(**parameters):
    return [(parse(text), parameter) for text, parameter in parameters.items()]


def test_model_without_regressor_is_refused():
    with pytest.raises(ModelError, match="a model has at least one regressor"):
        Model(())


@pytest.mark.parametrize("texts", [("u(k-1)", "y(k-1)"), ("y(k-1)", "y(k-1)"), ("1", "y(k-1)")])
def test_regressors_out_of_order_or_repeated_are_refused(texts):
    with pytest.raises(ModelError, match="must be in canonical order without repetition"):
        Model(items(*texts))


def test_make_model_moves_factors_into_parameters_and_merges_terms():
    made = make_model(
        [
            (parse("2*u(k-1)*y(k-1)"), 0.5),
            (parse("phi1(u(k-2), u(k-1))"), 0.25),
            (parse("y(k-1)*q1(u(k))"), 3.0),
            (parse("phi1(u(k-4), u(k-4))"), 9.0),
            (parse("-4"), 0.125),
        ],
        dt=0.01,
    )
    assert [plain(item.expression) for item in made.regressors] == ["y(k-1)*u(k-1)", "u(k-1) - u(k-2)", "1"]
    assert made.theta == (4.0, -0.25, -0.5)
    assert (made.dt, made.input_names, made.output_name) == (0.01, ("u",), "y")


def test_make_model_of_a_non_causal_term_is_refused():
    with pytest.raises(ModelError, match="reads only past samples: channel 1 has lag 0"):
        make_model([(parse("y(k-1)"), 1.0), (parse("u(k)"), 1.0)])


@given(models(inputs=2))
def test_make_model_of_the_terms_of_a_model_returns_an_equal_model(model):
    again = make_model(
        [(item.expression, theta) for item, theta in zip(model.regressors, model.parameters, strict=True)][
            ::-1
        ],
        model.input_names,
    )
    assert again == model
    assert hash(again) == hash(model)
