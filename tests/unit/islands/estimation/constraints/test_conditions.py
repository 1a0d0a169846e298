"""Constraints on a structure and on a library."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.models.narx import canonical_order
from islands.models.regressor import regressor


def make_regressors(*texts):
    return canonical_order(regressor(parse(text))[1] for text in texts)


def texts(regressors):
    return [plain(item.expression) for item in regressors]


def rows(text, *terms):
    """Return every row as ({text of the term: coefficient}, target)."""
    found = constraint(text).constrain(make_regressors(*terms))
    return [
        ({name: weight for name, weight in zip(texts(found.regressors), row, strict=True) if weight}, target)
        for row, target in zip(found.S.tolist(), found.c.tolist(), strict=True)
    ]


def test_fixed_point_weighs_every_term_with_its_steady_state():
    expected = {"y(k-1)": 3.0, "u(k-1)": 2.0, "u(k-2)^2": 4.0, "y(k-2)*u(k-1)": 6.0}
    assert rows("fixed-point = 2, 3", *TERMS) == [(expected, 3.0)]


def test_gain_weighs_every_term_with_the_slope_along_the_characteristic():
    # d(y u) = y du + u dy, with dy = G du.
    expected = {"y(k-1)": 0.5, "u(k-1)": 1.0, "u(k-2)^2": 4.0, "y(k-2)*u(k-1)": 3.0 + 2.0 * 0.5}
    assert rows("gain = 0.5 at 2, 3", *TERMS) == [(expected, 0.5)]
    assert rows("gain = 0.5", *TERMS) == [({"y(k-1)": 0.5, "u(k-1)": 1.0}, 0.5)]


TERMS = ("y(k-1)", "u(k-1)", "u(k-2)^2", "y(k-2)*u(k-1)", "phi2(u(k-1), u(k-2))")


@pytest.mark.parametrize(
    ("text", "removed"),
    [
        ("odd", {"u(k-2)^2", "y(k-2)*u(k-1)"}),
        ("even", {"u(k-1)", "y(k-2)*u(k-1)", "sign(u(k-1) - u(k-2))"}),
        ("[u(k-1)] = 0", {"u(k-1)"}),
        ("[u(k-1)] = 0; [u(k-1)] + [u(k-2)^2] = 0", {"u(k-1)", "u(k-2)^2"}),
        ("fixed-point = 0, 0", set()),
    ],
)
def test_terms_whose_parameter_is_zero_are_removed(text, removed):
    items = make_regressors(*TERMS)
    found = constraint(text).constrain(items)
    assert set(texts(items)) - set(texts(found.regressors)) == removed


@pytest.mark.parametrize("text", ["fixed-point = 1e200, 1e200", "gain = 1 at 1e200, 0"])
def test_term_that_overflows_at_the_point_is_removed(text):
    items = make_regressors("y(k-1)", "u(k-1)", "sin(u(k-1)^2)")
    assert texts(constraint(text).constrain(items).regressors) == ["y(k-1)", "u(k-1)"]


@pytest.mark.parametrize(
    "text",
    ["gain = 2 at 1, 1", "fixed-point = 1, 2", "hysteresis; [y(k-1)] - [y(k-2)] = 0.5", "odd; gain = 3"],
)
def test_directions_over_a_library_preserve_every_row(text):
    library = make_regressors(
        "y(k-1)", "y(k-2)", "u(k-1)", "u(k-2)", "u(k-1)^2", "u(k-1)*y(k-1)", "u(k-2)*y(k-1)", "y(k-1)^3"
    )
    given = constraint(text)
    found = given.directions(library)
    S, _ = given._rows(library)
    for direction in found.free:
        chosen = [library.index(item) for item in direction.regressors]
        assert np.linalg.matrix_rank(S[:, chosen]) < len(chosen)
    independent = np.linalg.matrix_rank(S[:, [given.admits(item) for item in library]])
    admitted = sum(map(given.admits, library))
    assert len(found.free) == admitted - independent


@pytest.mark.parametrize(
    ("text", "inputs"),
    [("fixed-point = 1, 2", 2), ("fixed-point = 1, 2, 3", 1), ("gain(u2) = 1", 1), ("[u2(k-1)] = 0", 1)],
)
def test_constraint_on_other_inputs_than_the_record_has_raises_settings_error(text, inputs):
    with pytest.raises(SettingsError, match="correct one of them"):
        constraint(text).check_inputs(inputs)
    for harmless in ("gain(u2) = 1", "odd", "[u(k-1)] = 0", "gain = 2 at 1, 2, 3"):
        constraint(harmless).check_inputs(2)
