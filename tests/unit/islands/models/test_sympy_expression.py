"""Models as SymPy equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import islands
from islands.expressions.evaluation import value
from islands.expressions.primitives import PRIMITIVES
from islands.models.sympy_expression import to_sympy

pytestmark = pytest.mark.ci

LEVELS = st.floats(-3.0, 3.0, allow_subnormal=False).filter(lambda number: number == 0 or abs(number) > 1e-3)


def evaluate(equation, levels):
    """Evaluate the right-hand side with numbers for the signals, by name and lag."""
    import sympy

    k = sympy.Symbol("k", integer=True)
    calls = [sympy.Function(name, real=True)(k - lag) for name, lag in levels]
    return sympy.lambdify(calls, equation.rhs, "math")(*levels.values())


@pytest.mark.parametrize("name", sorted(set(PRIMITIVES)))
@given(a=LEVELS, b=LEVELS)
def test_every_primitive_has_its_value(name, a, b):
    arguments = ("y(k-1)", "u(k-2)")[: PRIMITIVES[name].arity]
    expression = islands.parse(f"{name}({', '.join(arguments)})")
    model = islands.make_model([(expression, 1.5), (islands.parse("u(k-2)"), 0.25)])
    expected = 1.5 * value(expression, lambda channel, _lag: (a, b)[channel]) + 0.25 * b
    found = evaluate(to_sympy(model), {("y", 1): a, ("u", 2): b})
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_the_lambdified_equation_is_the_prediction_of_the_model():
    import sympy

    terms = {"y(k-1)": 0.7, "u(k-1)*sign(u(k-1) - u(k-2))": 0.3, "tanh(y(k-2))*u(k-2)": -0.2, "1": 0.05}
    model = islands.make_model(
        ((islands.parse(term), number) for term, number in terms.items()), ("u_V+1",), "y_um"
    )
    rng = np.random.default_rng(0)
    record = islands.Dataset(rng.normal(size=100), rng.normal(size=100), 1.0, ("u_V",), "y_um")
    predicted = islands.simulate(model, record, "one-step").y
    equation = to_sympy(model)
    assert str(equation.lhs) == "y_um(k)"
    k = sympy.Symbol("k", integer=True)
    y, u = (sympy.Function(name, real=True) for name in ("y_um", "u_V"))
    # The column u_V+1 is read at sample k.
    function = sympy.lambdify([y(k - 1), y(k - 2), u(k), u(k - 1)], equation.rhs)
    signal, output = record.u[:, 0], record.y
    expected = function(output[1:-1], output[:-2], signal[2:], signal[1:-1])
    assert np.allclose(predicted[2:], expected, rtol=1e-12, atol=1e-12)


def test_a_primitive_of_the_user_is_an_undefined_function():
    soft = islands.primitive("soften", lambda a: a / (1.0 + abs(a)))
    model = islands.make_model([(islands.parse("soften(y(k-1))", {"soften": soft}), 2.0)])
    assert str(to_sympy(model).rhs) == "2.0*soften(y(k - 1))"
