"""Exports: the Python module computes the kernel's numbers bit for bit, whatever stands in the model."""

import json
import math
from math import exp

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import models

import islands
from islands.data.dataset import Dataset
from islands.errors import ModelError, SettingsError
from islands.io.export import EXPORTS, export
from islands.io.models import model_json
from islands.model.primitives import PRIMITIVES, primitive
from islands.simulation.predictors import free_run, one_step_ahead
from islands.systems.published_models import PUBLISHED

SAMPLES = 60


def record(inputs=1, seed=0):
    rng = np.random.default_rng(seed)
    return Dataset(rng.normal(size=(SAMPLES, inputs)), rng.normal(size=SAMPLES), 0.1)


def model(terms, names=("u",), primitives=PRIMITIVES):
    return islands.model_of(
        [(islands.parse(text, primitives), value) for text, value in terms.items()], names
    )


def module(exported):
    """Run an exported module in a namespace of its own."""
    namespace = {}
    exec(export(exported, "python"), namespace)
    return namespace


def columns(data):
    return [column.tolist() for column in data.u.T]


def assert_same_free_run(exported, data):
    made = module(exported)
    ours = free_run(exported, data)
    assert ours.outcome
    theirs = made["simulate"](*columns(data), data.y.tolist())
    assert made["MAXIMUM_LAG"] == exported.maximum_lag
    assert len(theirs) == data.samples
    assert theirs[: exported.maximum_lag] == data.y[: exported.maximum_lag].tolist()
    assert theirs[exported.maximum_lag :] == ours.y[exported.maximum_lag :].tolist()


@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_python_module_computes_every_primitive_as_the_kernel_does(name):
    arguments = "u(k-1), y(k-2)" if PRIMITIVES[name].arity == 2 else "u(k-1) - 0.3*y(k-2)"
    assert_same_free_run(model({"y(k-1)": 0.3, f"{name}({arguments})*u(k-3)": 0.01, "1": 0.1}), record())


@pytest.mark.parametrize("number", PUBLISHED)
def test_the_python_module_simulates_every_published_model_as_the_kernel_does(number):
    assert_same_free_run(PUBLISHED[number].model, record())


def test_sums_and_products_of_many_parts_stand_in_the_kernels_order():
    terms = {
        "y(k-1)*y(k-2)*u(k-1)*u(k-2)*u(k-3)*tanh(y(k-3))*0.1*u(k-4)": 0.07,
        "(u(k-1) + 0.1*u(k-2) - 0.7*u(k-3) + 1e-3)*(y(k-1) - 0.3)^3": 0.011,
        "u(k-1)^9": 1e-4,
        "-2.5": 0.3,
        "y(k-5)": 0.1,
    }
    assert_same_free_run(model(terms), record())


def test_several_inputs_are_arguments_in_their_order():
    terms = {"y(k-1)": 0.5, "u1(k-1)": 0.1, "u3(k-2)*u2(k-1)": 0.2, "max(u2(k-1), -0.25)": 0.3}
    assert_same_free_run(model(terms, ("a_V", "b_A", "c_K")), record(3))


def test_a_constant_needs_no_past():
    assert_same_free_run(model({"1": 0.75}), record())


@settings(max_examples=60)
@given(models(), st.integers(0, 2**32 - 1))
def test_the_python_module_is_the_model_bit_for_bit(random_model, seed):
    data = record(2, seed)
    run = free_run(random_model, data)
    # A diverging free run ends at the bound; Python goes on, to infinity or an error of its math.
    assume(run.outcome)
    try:
        theirs = module(random_model)["simulate"](*columns(data), data.y.tolist())
    except (ValueError, OverflowError):
        assume(False)
    assert theirs[random_model.maximum_lag :] == run.y[random_model.maximum_lag :].tolist()


def test_predict_is_one_step_ahead():
    data, chosen = record(), PUBLISHED["12"].model
    predict = module(chosen)["predict"]
    predicted = [predict(k, data.y.tolist(), *columns(data)) for k in range(3, SAMPLES)]
    assert predicted == one_step_ahead(chosen, data).y[3:].tolist()


def test_the_module_says_what_the_model_is():
    text = export(PUBLISHED["12"].model, "python")
    assert text.startswith('"""NARX model: y(k) = 1*y(k-1)')
    assert "Inputs u = u_V; output y = y_um; sampling time 0.001 s." in text
    assert text.count("import ") == 1
    assert "sampling time any" in export(model({"y(k-1)": 1.0}), "python")


@pytest.mark.parametrize("name", ['u"""', "u\\Nm", 'u"', "u\n", "u\\", "µ_µm", '"""\nraise SystemExit\n"""'])
def test_a_columns_name_cannot_break_the_module(name):
    made = module(islands.model_of([(islands.parse("u(k-1)"), 2.0)], (name,), name))
    assert f"Inputs u = {name}; output y = {name};" in made["__doc__"]
    assert made["simulate"]([1.0, 2.0], [0.5]) == [0.5, 2.0]


# A user's own primitives.

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


def renamed(factor):
    def saturation(a):
        return factor * a

    return saturation


OWN = {
    "numbers of its module": saturation,
    "a NumPy number": shared,
    "math by another name": by_another_name,
    "a function of math": taken_from_math,
    "a name of the export": predict,
    "a name of a signal": u,
    "a function of its own": nested,
    "a closure": limited(0.5),
}


@pytest.mark.parametrize("scalar", OWN.values(), ids=OWN)
def test_a_users_own_primitive_is_exported_with_all_that_it_uses(scalar):
    known = PRIMITIVES | {"own": primitive("own", scalar)}
    arguments = "u(k-1), y(k-1)" if known["own"].arity == 2 else "u(k-1)"
    assert_same_free_run(model({f"own({arguments})": 0.3, "y(k-2)": 0.2}, primitives=known), record())


def test_two_primitives_may_be_functions_of_one_name():
    known = PRIMITIVES | {"a": primitive("a", saturation), "b": primitive("b", renamed(0.1))}
    assert_same_free_run(model({"a(u(k-1))*b(y(k-1))": 0.3}, primitives=known), record())


def test_the_constants_stand_once_and_by_their_names():
    known = PRIMITIVES | {"a": primitive("a", saturation)}
    text = export(model({"a(u(k-1)) + log(u(k-2))": 1.0}, primitives=known), "python")
    lines = text.splitlines()
    assert [line for line in lines if " = " in line and line[0].isupper() and "Inputs" not in line] == [
        "MAXIMUM_LAG = 2",
        "STRENGTH = 2.0",
        "OFFSET = 3",
        "TINY = 1e-09",
    ]


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
    assert refused(math.erf) == "the source of primitive 'own' is not at hand: define it with def in a file"
    namespace = {}
    exec("def typed(a):\n    return 0.5 * a", namespace)
    assert "define it with def in a file" in refused(namespace["typed"])


def uses_a_table(a):
    return NOTHING["strength"] * a


def uses_another(a):
    return saturation(a)


@pytest.mark.parametrize(("scalar", "name"), [(uses_a_table, "NOTHING"), (uses_another, "saturation")])
def test_what_is_neither_math_nor_a_number_is_refused_by_name(scalar, name):
    assert refused(scalar) == f"primitive 'own' uses {name}: an export knows math and numbers alone"


def test_numbers_that_would_overwrite_each_other_are_refused():
    assert refused(limited(0.5), other=limited(0.75)) == (
        "primitive 'own' uses limit, a name that stands for something else in the export: rename it"
    )


MAXIMUM_LAG = 7


def with_a_taken_name(a):
    return MAXIMUM_LAG * a


def test_a_number_with_a_name_of_the_export_is_refused():
    assert "'own' uses MAXIMUM_LAG, a name that stands for something else" in refused(with_a_taken_name)


# The other kinds.


def test_the_other_kinds_are_text_equation_latex_and_model_file():
    assert list(EXPORTS) == ["plain", "latex", "python", "json"]
    chosen = model({"y(k-1)": 0.5, "u(k-1)": 0.25})
    assert export(chosen, "plain") == "y(k) = 0.5*y(k-1) + 0.25*u(k-1)"
    assert export(chosen, "latex") == r"y_{k} = 0.5 \, y_{k-1} + 0.25 \, u_{k-1}"
    assert export(chosen, "json") == model_json(chosen)
    assert json.loads(export(chosen, "json"))["inputs"] == ["u"]


def test_an_unknown_kind_is_refused():
    with pytest.raises(SettingsError) as caught:
        export(PUBLISHED["12"].model, "fortran")
    assert str(caught.value) == "unknown format 'fortran': take one of plain, latex, python, json"


def test_a_structure_without_parameters_is_no_program():
    structure = islands.Model(PUBLISHED["12"].model.regressors)
    with pytest.raises(ModelError, match="no parameters yet"):
        export(structure, "python")
    assert export(structure, "plain").startswith("y(k) = theta1*y(k-1)")
