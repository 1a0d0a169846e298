"""Functions of units: text, tree, code and values are one function."""

import numpy as np
import pytest

from islands.errors import ModelError
from islands.models.unit_functions import FUNCTIONS, evaluate_curve, make_odd_unit, parse_unit

TREES = {
    "tanh": np.tanh,
    "tanh(square)": lambda s: np.tanh(s**2),
    "s*abs": lambda s: s * np.abs(s),
    "bell*s": lambda s: np.exp(-(s**2)) * s,
    "cube(s*tanh)": lambda s: (s * np.tanh(s)) ** 3,
    "abs*s*tanh(s*cube)": lambda s: np.abs(s) * s * np.tanh(s**4),
}


@pytest.mark.parametrize("text", [*FUNCTIONS, *TREES])
def test_the_text_is_read_as_it_is_written(text):
    assert str(parse_unit(text)) == text


@pytest.mark.ci
@pytest.mark.parametrize("text", TREES)
def test_a_tree_has_the_values_of_its_text(text):
    s = np.linspace(-1.5, 1.5, 31)
    assert evaluate_curve(text, s) == pytest.approx(TREES[text](s))
    written = parse_unit(text).write("s").replace("^", "**")
    names = {"tanh": np.tanh, "exp": np.exp, "abs": np.abs}
    assert eval(written, names, {"s": s}) == pytest.approx(TREES[text](s))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cosh", "unknown unit 'cosh'"),
        ("tanh(", "unknown unit"),
        ("tanh)", "unknown unit"),
        ("", "unknown unit"),
        ("s", "too large or empty"),
        ("*".join(["s"] * 10), "too large"),
        ("s*(s*(s*(s*s)))", "too large"),
    ],
)
def test_an_impossible_unit_is_refused(text, message):
    with pytest.raises(ModelError, match=message):
        parse_unit(text)


@pytest.mark.ci
@pytest.mark.parametrize(
    "text", [*FUNCTIONS, *TREES, "hinge*abs", "tanh(hinge)", "bell(root)", "abs*root(bell)"]
)
def test_the_parity_is_that_of_the_values(text):
    s = np.linspace(0.1, 1.5, 8)
    ahead, behind = evaluate_curve(text, s), evaluate_curve(text, -s)
    parity = 1 if np.allclose(ahead, behind) else -1 if np.allclose(ahead, -behind) else 0
    assert parse_unit(text).parity == parity
    odd = make_odd_unit(text)
    assert parse_unit(odd).parity == -1
    assert (odd == text) == (parity == -1)
