"""Modelica export: its right-hand side is the model, and its functions, units and columns."""

import re
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import ModelError
from islands.export import export
from islands.expressions.evaluation import value
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from support.block_cases import OF_STATES
from support.programs import CASES, model

SAMPLED = {name: replace(each, dt=each.dt or 0.1) for name, each in CASES.items()} | OF_STATES


def body(text):
    """Return the equations of the block, without the right-hand side of y."""
    equations = text.partition("equation\n")[2].partition("then\n")[2].partition("  end when;")[0]
    return [each.strip() for each in equations.split(";") if each.strip()]


@pytest.mark.parametrize("name", SAMPLED)
def test_the_right_hand_side_is_the_model(name):
    exported = SAMPLED[name]
    right = body(export(exported, "modelica"))[0].removeprefix("y = ")
    right = " ".join(right.split())
    assert not re.search(r"[-+*/]\s*-", right)
    text = re.sub(r"pre\(past_(y|u\d*)\[(\d+)\]\)", r"\1(k-\2)", right).replace("f_", "")
    # The parser reads no present sample.
    text = re.sub(r"\b(u\d*)(?![\d(])", r"\1(k-99)", text)
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(exported.inputs + 1, 100))
    leads = exported.leads

    def read_model(channel, lag):
        return samples[channel][lag - leads[channel] or 99]

    terms = zip(exported.parameters, exported.regressors, strict=True)
    expected = sum(theta * value(item.expression, read_model) for theta, item in terms)
    found = value(islands.parse(text), lambda channel, lag: samples[channel][lag])
    assert found == pytest.approx(expected, rel=1e-12)


def test_the_block_has_the_units_and_the_columns():
    exported = replace(model({"u(k-1)": 1.0}), input_names=('u "1" \\ [V]',), output_name="y_um", dt=1e-3)
    text = export(exported, "modelica")
    assert r'RealInput u(unit = "V") "u \"1\" \\ [V]";' in text
    assert 'RealOutput y(unit = "um") "y_um";' in text
    assert "when sample(0, 0.001) then" in text


def test_a_user_defined_primitive_is_refused():
    known = PRIMITIVES | {"own": primitive("own", lambda a: a)}
    exported = replace(model({"own(u(k-1))": 1.0}, primitives=known), dt=0.1)
    with pytest.raises(ModelError, match="only built-in primitives"):
        export(exported, "modelica")
