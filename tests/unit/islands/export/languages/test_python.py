"""Table of export formats, and the Python export, which equals the kernel bit for bit for any model."""

import math
from math import exp

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import islands
from islands.errors import ModelError
from islands.export import export
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.models.regressor import Regressor
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.systems.published_models import PUBLISHED
from support.programs import CASES, HOSTILE_NAMES, bits, model, record
from support.strategies import models


def module(exported):
    """Run an exported module in a separate namespace."""
    namespace = {}
    exec(export(exported, "python"), namespace)
    return namespace


def columns(data):
    return [column.tolist() for column in data.u.T]


def simulated(exported, data):
    return module(exported)["simulate"](*columns(data), data.y.tolist())


def assert_same_free_run(exported, data):
    ours = free_run(exported, data)
    assert ours.outcome
    theirs = simulated(exported, data)
    lag = exported.maximum_lag
    assert bits(theirs) == bits([*data.y[:lag], *ours.y[lag:]])


def test_a_program_reads_the_present_of_an_input_that_the_model_reads_early():
    exported = model({"y(k-1)": 0.5, "u(k-1)*u(k-2)": 2.0, "u(k-1)": 1.0}, ("u_V+1",))
    data = Dataset(np.linspace(-1.0, 1.0, 9) ** 3, np.zeros(9), 0.1, ("u_V",))
    assert_same_free_run(exported, data)
    assert "u = u_V;" in export(exported, "python")
    assert "u[0]*u[-1]" in export(exported, "c")
    assert "never a later sample than u[0]." in export(exported, "c")
    assert "u(k)*u(k-1)" in export(exported, "matlab")


@pytest.mark.ci
@given(models(), st.integers(0, 2**32 - 1))
def test_the_python_module_equals_the_model_bit_for_bit(random_model, seed):
    data = record(2, seed)
    run = free_run(random_model, data)
    # The kernel stops a diverging free run at the bound; Python continues to infinity or to a math error.
    assume(run.outcome)
    try:
        theirs = simulated(random_model, data)
    except (ValueError, OverflowError):
        assume(False)
    lag = random_model.maximum_lag
    assert bits(theirs[lag:]) == bits(run.y[lag:])


@pytest.mark.parametrize(("kind", "quote"), [("python", ""), ("c", '"'), ("matlab", '"')])
def test_every_program_names_the_columns_of_its_inputs(kind, quote):
    text = export(CASES["several inputs"], kind)
    named = [f"u{number} = {quote}{name}{quote}" for number, name in ((1, "a_V"), (2, "b_A"), (3, "c_K"))]
    assert f"Inputs {', '.join(named)}; output" in text


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_a_column_name_cannot_break_the_module(name):
    made = module(islands.make_model([(islands.parse("u(k-1)"), 2.0)], (name,), name))
    assert f"Inputs u = {name}; output y = {name};" in made["__doc__"]
    assert made["simulate"]([1.0, 2.0], [0.5]) == [0.5, 2.0]


# User-defined primitives.

STRENGTH, OFFSET = 2.0, 3
SHARE = np.float64(0.25)
NOTHING = {"strength": 2.0}
maths = math


def saturation(a):
    return a / (STRENGTH + abs(a)) + OFFSET


def shared(a):
    """Take a share of it."""
    return SHARE * a


def by_another_name(a):
    return maths.tanh(a) * math.pi


def taken_from_math(a):
    return exp(min(a, 3.0))


def predict(a):
    return 0.5 * a


def u(a, b):
    return 0.5 * a - b


def nested(a):
    def half(b):
        return 0.5 * b

    return half(a) - half(1.0)


def limited(limit):
    def clipped(a):
        return max(-limit, min(limit, a))

    return clipped


OWN = {
    "numbers of its module": saturation,
    "a NumPy number": shared,
    "math under another name": by_another_name,
    "a function of math": taken_from_math,
    "a name of the export": predict,
    "a name of a signal": u,
    "a nested function": nested,
    "a closure": limited(0.5),
}


@pytest.mark.parametrize("scalar", OWN.values(), ids=OWN)
def test_a_user_defined_primitive_is_exported_with_its_globals(scalar):
    known = PRIMITIVES | {"own": primitive("own", scalar)}
    arguments = "u(k-1), y(k-1)" if known["own"].arity == 2 else "u(k-1)"
    assert_same_free_run(model({f"own({arguments})": 0.3, "y(k-2)": 0.2}, primitives=known), record())


def refused(scalar, **others):
    known = PRIMITIVES | {"own": primitive("own", scalar)}
    known |= {name: primitive(name, other) for name, other in others.items()}
    product = "*".join(["own(u(k-1))", *(f"{name}(u(k-1))" for name in others)])
    with pytest.raises(ModelError) as caught:
        export(model({product: 1.0}, primitives=known), "python")
    return str(caught.value)


def test_a_lambda_is_refused_with_advice():
    message = "primitive 'own' can't be exported: write it with def, not as a lambda and without a decorator"
    assert refused(lambda a: 0.5 * a) == message
    named = {"half": lambda a: 0.5 * a}
    assert refused(named["half"]) == message


def test_a_function_without_source_is_refused_with_advice():
    assert refused(math.erf) == "the source of primitive 'own' is not available: define it with def in a file"
    namespace = {}
    exec("def typed(a):\n    return 0.5 * a", namespace)
    assert "define it with def in a file" in refused(namespace["typed"])


def uses_a_table(a):
    return NOTHING["strength"] * a


def uses_another(a):
    return saturation(a)


@pytest.mark.parametrize(("scalar", "name"), [(uses_a_table, "NOTHING"), (uses_another, "saturation")])
def test_other_globals_than_math_and_numbers_are_refused_by_name(scalar, name):
    assert refused(scalar) == f"primitive 'own' uses {name}: an export may only use math and numbers"


def test_numbers_that_would_overwrite_each_other_are_refused():
    assert refused(limited(0.5), other=limited(0.75)) == (
        "primitive 'own' uses limit, a name that means something else in the export: rename it"
    )


# Other formats.


PROGRAMS = ["python", "c", "matlab"]


@pytest.mark.parametrize("kind", PROGRAMS)
def test_a_structure_without_parameters_is_not_exported(kind):
    structure = islands.Model(PUBLISHED["12"].model.regressors)
    with pytest.raises(ModelError, match="no parameters yet"):
        export(structure, kind)
    assert export(structure, "plain").startswith("y(k) = theta1*y(k-1)")


@pytest.mark.parametrize("kind", PROGRAMS)
@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_a_parameter_that_is_not_finite_is_refused_with_its_regressor(kind, number):
    with pytest.raises(ModelError) as caught:
        export(model({"y(k-1)": 0.5, "u(k-2)": number}), kind)
    assert str(caught.value) == f"the parameter of u1(k-2) is {number}: an export needs finite parameters"


@pytest.mark.parametrize("kind", PROGRAMS)
def test_a_regressor_that_is_not_in_canonical_form_is_refused(kind):
    shifted = islands.Model((Regressor(islands.parse("q2(u(k-1))")),), (1.0,))
    with pytest.raises(ModelError, match="not in canonical form: bring it there with `regressor`"):
        export(shifted, kind)
