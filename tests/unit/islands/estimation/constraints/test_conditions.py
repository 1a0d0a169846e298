"""Constraints on a structure and on a library."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.estimation.parameter_constraints import constraint, count_free_parameters
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.models.narx import Model, canonical_order
from islands.models.regressor import regressor
from islands.simulation.outcome import EvaluationOutcome, Status


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


TERMS = ("y(k-1)", "u(k-1)", "u(k-2)^2", "y(k-2)*u(k-1)", "phi2(u(k-1), u(k-2))")


def test_fixed_point_weighs_every_term_with_its_steady_state():
    expected = {"y(k-1)": 3.0, "u(k-1)": 2.0, "u(k-2)^2": 4.0, "y(k-2)*u(k-1)": 6.0}
    assert rows("fixed-point = 2, 3", *TERMS) == [(expected, 3.0)]


def test_gain_weighs_every_term_with_the_slope_along_the_characteristic():
    # d(y u) = y du + u dy, with dy = G du.
    expected = {"y(k-1)": 0.5, "u(k-1)": 1.0, "u(k-2)^2": 4.0, "y(k-2)*u(k-1)": 3.0 + 2.0 * 0.5}
    assert rows("gain = 0.5 at 2, 3", *TERMS) == [(expected, 0.5)]
    assert rows("gain = 0.5", *TERMS) == [({"y(k-1)": 0.5, "u(k-1)": 1.0}, 0.5)]


def test_gain_of_the_second_input_keeps_the_first_constant():
    expected = {"y(k-1)": 0.5, "u2(k-1)": 1.0, "u1(k-1)*u2(k-1)": 4.0}
    found = constraint("gain(u2) = 0.5 at 4, 5, 6").constrain(
        make_regressors("y(k-1)", "u1(k-1)", "u2(k-1)", "u1(k-1)*u2(k-1)")
    )
    names = [plain(item.expression, 2) for item in found.regressors]
    assert {n: w for n, w in zip(names, found.S[0].tolist(), strict=True) if w} == expected


def test_absent_term_of_an_equality_has_the_parameter_zero():
    assert rows("[u(k-1)] + 2*[u(k-9)] = 1", *TERMS) == [({"u(k-1)": 1.0}, 1.0)]
    found = constraint("[u(k-9)] = 1").constrain(make_regressors(*TERMS))
    assert found.verdict is Status.INFEASIBLE
    assert "[u(k-9)] = 1" in found.reason


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


def test_fixed_point_at_the_origin_removes_the_constant():
    found = constraint("fixed-point = 0, 0").constrain(make_regressors("y(k-1)", "1"))
    assert texts(found.regressors) == ["y(k-1)"]
    assert found.c.size == 0


def test_term_without_a_slope_at_the_operating_point_is_removed():
    items = make_regressors("y(k-1)", "abs(u(k-1))", "u(k-1)")
    assert texts(constraint("gain = 1").constrain(items).regressors) == ["y(k-1)", "u(k-1)"]
    assert constraint("gain = 1 at 1, 0").constrain(items).regressors == tuple(items)


@pytest.mark.parametrize("text", ["fixed-point = 1e200, 1e200", "gain = 1 at 1e200, 0"])
def test_term_that_overflows_at_the_point_is_removed(text):
    items = make_regressors("y(k-1)", "u(k-1)", "sin(u(k-1)^2)")
    assert texts(constraint(text).constrain(items).regressors) == ["y(k-1)", "u(k-1)"]


def test_rows_that_follow_from_others_do_not_count():
    items = make_regressors(*TERMS)
    # The mirrored point makes the constraints on the odd and on the even terms separate.
    assert count_free_parameters(Model(items), "fixed-point = 1, 1") == 4
    assert count_free_parameters(Model(items), "fixed-point = 1, 1; fixed-point = 1, 1.0") == 4
    assert (
        count_free_parameters(Model(make_regressors("y(k-1)", "u(k-1)")), "gain = 2; fixed-point = 1, 2") == 1
    )


def test_contradiction_is_infeasible():
    found = constraint("[u(k-1)] = 1; 2*[u(k-1)] = 3").constrain(make_regressors(*TERMS))
    assert isinstance(found, EvaluationOutcome)
    assert found.verdict is Status.INFEASIBLE


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
