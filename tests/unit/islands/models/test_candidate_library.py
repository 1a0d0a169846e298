"""Candidate libraries: contents of small libraries, counts of large ones."""

import pytest

from islands.errors import SettingsError
from islands.expressions.printing import plain
from islands.expressions.tree import Apply
from islands.models.candidate_library import candidates, full_set
from islands.models.clusters import steady_state


def texts(name, degree, lags, inputs=1):
    return [plain(item.expression, inputs) for item in candidates(name, degree, lags, inputs)]


def test_full_set_of_the_paper_has_80_729_terms_and_the_constant():
    assert full_set(5, 11, 11) == 80_729 + 1


# Contents.


def test_polynomial_library_contains_every_monomial_and_the_constant():
    assert sorted(texts("polynomial", 1, 1)) == sorted(["1", "y(k-1)", "u(k-1)"])
    second = ["y(k-1)^2", "y(k-1)*u(k-1)", "u(k-1)^2"]
    assert sorted(texts("polynomial", 2, 1)) == sorted(["1", "y(k-1)", "u(k-1)", *second])
    lagged = ["1", "y(k-1)", "y(k-2)", "u(k-1)", "u(k-2)"]
    assert sorted(texts("polynomial", 1, 2)) == sorted(lagged)
    two = ["1", "y(k-1)", "u1(k-1)", "u2(k-1)", "y(k-1)^2", "u1(k-1)^2", "u2(k-1)^2"]
    mixed = ["y(k-1)*u1(k-1)", "y(k-1)*u2(k-1)", "u1(k-1)*u2(k-1)"]
    assert sorted(texts("polynomial", 2, 1, inputs=2)) == sorted([*two, *mixed])


@pytest.mark.parametrize(("degree", "lags", "inputs"), [(1, 2, 1), (5, 3, 1), (3, 4, 2), (2, 3, 3)])
def test_phi_polynomial_terms_except_y_vanish_in_the_steady_state(degree, lags, inputs):
    first, *others = candidates("phi-polynomial", degree, lags, inputs)
    assert plain(first.expression) == "y(k-1)"
    assert {steady_state(item)[0] for item in others} == {0.0}
    assert {lag for item in others for _, lag in item.lags} == set(range(1, lags + 1))


def _find_calls(expression):
    if isinstance(expression, Apply):
        yield expression
        for argument in expression.arguments:
            yield from _find_calls(argument)


def test_phi_polynomial_candidates_only_use_the_paper_s_functions():
    found = candidates("phi-polynomial", 3, 3, 1)
    used = {node.primitive.name for item in found for node in _find_calls(item.expression)}
    assert used == {"mul", "sub", "sign"}


# Errors.


@pytest.mark.parametrize(("degree", "lags"), [(0, 1), (1, 0), (-1, 3)])
def test_degree_or_lags_below_one_are_refused(degree, lags):
    with pytest.raises(SettingsError) as caught:
        candidates("polynomial", degree, lags, 1)
    assert str(caught.value) == f"degree and lags are at least 1, got {degree} and {lags}"


def test_phi_polynomial_with_one_lag_is_refused():
    with pytest.raises(SettingsError, match="needs lags of at least 2: a first difference uses two samples"):
        candidates("phi-polynomial", 2, 1, 1)


def test_too_large_library_is_refused_before_it_is_built():
    with pytest.raises(SettingsError) as caught:
        candidates("polynomial", 5, 11, 1)
    assert str(caught.value) == (
        "80730 candidates are more than a library may have (4000): take a smaller degree or fewer lags"
    )
    with pytest.raises(SettingsError, match=r"^[0-9]{30,} candidates are more"):
        candidates("polynomial", 40, 40, 3)
    with pytest.raises(SettingsError, match=r"^[0-9]{30,} candidates are more"):
        candidates("phi-polynomial", 500, 1_000_000, 9)
