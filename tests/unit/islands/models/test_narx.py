"""Models: validation, properties and construction from terms."""

import pytest
from hypothesis import given

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.expressions.tree import Constant
from islands.models.narx import Model, canonical_order, make_model
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


def test_canonical_order_sorts_and_drops_repetitions():
    ordered = canonical_order(items("3", "y(k-1)*u(k-1)", "u(k-2)", "y(k-1)", "u(k-1)*y(k-1)"))
    assert [plain(item.expression) for item in ordered] == ["y(k-1)", "u(k-2)", "y(k-1)*u(k-1)", "1"]
    assert Model(tuple(ordered)).size == 4


@pytest.mark.parametrize("name", ["theta", "standard_errors"])
def test_wrong_number_of_parameters_is_refused(name):
    with pytest.raises(ModelError, match=f"3 {name} for 2 regressors"):
        Model(items("y(k-1)", "u(k-1)"), **{name: (1.0, 2.0, 3.0)})


def test_regressor_of_an_undeclared_input_is_refused():
    with pytest.raises(ModelError, match=r"reads input 3 and has 2: \('volts', 'load'\)"):
        Model(items("y(k-1)", "u3(k-1)"), input_names=("volts", "load"))
    assert Model(items("y(k-1)", "u2(k-1)"), input_names=("volts", "load")).inputs == 2


def test_constant_model_has_maximum_lag_zero():
    model = Model(items("1"), (2.5,))
    assert (model.size, model.maximum_lag, model.parameters) == (1, 0, (2.5,))


def test_maximum_lag_of_a_model_is_the_largest_of_its_regressors():
    assert Model(items("y(k-2)", "u(k-11)", "y(k-3)*u(k-4)")).maximum_lag == 11


def test_parameters_of_an_unestimated_model_raise_an_error():
    with pytest.raises(ModelError, match="the model has no parameters yet: estimate them first"):
        _ = Model(items("y(k-1)")).parameters


def test_with_parameters_returns_a_new_model():
    bare = Model(items("y(k-1)", "u(k-1)"), dt=0.5, output_name="x")
    made = bare.with_parameters([1, 2], [0.1, 0.2])
    assert (made.theta, made.standard_errors) == ((1.0, 2.0), (0.1, 0.2))
    assert (made.dt, made.output_name, made.regressors) == (0.5, "x", bare.regressors)
    assert bare.theta is None
    assert made.with_parameters([3, 4]).standard_errors is None
    with pytest.raises(ModelError, match="1 theta for 2 regressors"):
        bare.with_parameters([1.0])


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


def test_make_model_keeps_a_zero_parameter_for_cancelling_terms():
    made = make_model([(parse("u(k-1) - u(k-2)"), 1.0), (parse("u(k-2) - u(k-1)"), 1.0)])
    assert made.theta == (0.0,)


def test_make_model_of_zero_terms_is_refused():
    with pytest.raises(ModelError, match="a model has at least one regressor"):
        make_model([(parse("phi2(u(k-1), u(k-1))"), 1.0), (Constant(0.0), 2.0)])


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


def test_a_model_is_represented_by_its_regressors():
    model = make_model([(parse("y(k-1)"), 0.5), (parse("u(k-1)^2"), 1.0)])
    assert repr(model) == "<Model of y(k-1), u1(k-1)^2>"
