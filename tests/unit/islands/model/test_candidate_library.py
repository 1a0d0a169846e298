"""Libraries: their contents written out by hand where they are small, and counted where they are not."""

from itertools import product
from math import comb

import pytest

from islands.errors import SettingsError
from islands.model.candidate_library import LIBRARIES, MAX_CANDIDATES, candidates, full_set, library_named
from islands.model.clusters import steady_state
from islands.model.expression import Apply
from islands.model.model import canonical_order
from islands.model.rendering import plain


def texts(name, degree, lags, inputs=1):
    return [plain(item.expression, inputs) for item in candidates(name, degree, lags, inputs)]


def test_the_full_set_of_the_paper_has_80_729_terms_and_the_constant():
    assert full_set(5, 11, 11) == 80_729 + 1


@pytest.mark.parametrize(
    ("degree", "output_lags", "input_lags", "inputs"),
    [(1, 1, 1, 1), (3, 2, 4, 1), (2, 3, 1, 3), (4, 0, 2, 2)],
)
def test_the_full_set_counts_every_monomial(degree, output_lags, input_lags, inputs):
    signals = output_lags + inputs * input_lags
    powers = (exponents for exponents in product(range(degree + 1), repeat=signals))
    counted = sum(sum(exponents) <= degree for exponents in powers)
    assert full_set(degree, output_lags, input_lags, inputs) == counted == comb(signals + degree, degree)


# Contents.


def test_the_polynomial_library_holds_every_monomial_and_the_constant():
    assert sorted(texts("polynomial", 1, 1)) == sorted(["1", "y(k-1)", "u(k-1)"])
    second = ["y(k-1)^2", "y(k-1)*u(k-1)", "u(k-1)^2"]
    assert sorted(texts("polynomial", 2, 1)) == sorted(["1", "y(k-1)", "u(k-1)", *second])
    lagged = ["1", "y(k-1)", "y(k-2)", "u(k-1)", "u(k-2)"]
    assert sorted(texts("polynomial", 1, 2)) == sorted(lagged)
    two = ["1", "y(k-1)", "u1(k-1)", "u2(k-1)", "y(k-1)^2", "u1(k-1)^2", "u2(k-1)^2"]
    mixed = ["y(k-1)*u1(k-1)", "y(k-1)*u2(k-1)", "u1(k-1)*u2(k-1)"]
    assert sorted(texts("polynomial", 2, 1, inputs=2)) == sorted([*two, *mixed])


def test_the_phi_polynomial_library_holds_increments_times_directions_times_levels():
    increment, direction = "(u(k-1) - u(k-2))", "sign(u(k-1) - u(k-2))"
    assert sorted(texts("phi-polynomial", 1, 2)) == sorted(
        ["y(k-1)", "u(k-1) - u(k-2)", f"{direction}*{increment}"]
    )
    levels = ["y(k-1)", "u(k-1)"]
    assert sorted(texts("phi-polynomial", 2, 2)) == sorted(
        [
            *("y(k-1)", "u(k-1) - u(k-2)", f"{direction}*{increment}"),
            *(f"{level}*{increment}" for level in levels),
            *(f"{level}*{direction}*{increment}" for level in levels),
        ]
    )


def test_the_phi_polynomial_library_pairs_every_increment_with_every_direction_of_its_input():
    steps = ["u(k-1) - u(k-2)", "u(k-2) - u(k-3)"]
    pairs = [f"sign({direction})*({step})" for step in steps for direction in steps]
    assert sorted(texts("phi-polynomial", 1, 3)) == sorted(["y(k-1)", *steps, *pairs])


def test_with_two_inputs_increment_and_direction_are_of_one_input_and_levels_of_all():
    found = texts("phi-polynomial", 2, 2, inputs=2)
    assert len(found) == 1 + 2 * 2 * (1 + 3)
    assert "u2(k-1)*sign(u1(k-1) - u1(k-2))*(u1(k-1) - u1(k-2))" in found
    assert "u1(k-1)*(u2(k-1) - u2(k-2))" in found
    assert not [text for text in found if "sign(u1" in text and "*(u2" in text]
    assert not [text for text in found if "sign(u2" in text and "*(u1" in text]


@pytest.mark.parametrize(("degree", "lags", "inputs"), [(1, 2, 1), (5, 3, 1), (3, 4, 2), (2, 3, 3)])
def test_beside_y_every_term_of_phi_polynomial_vanishes_at_rest(degree, lags, inputs):
    first, *others = candidates("phi-polynomial", degree, lags, inputs)
    assert plain(first.expression) == "y(k-1)"
    assert {steady_state(item)[0] for item in others} == {0.0}
    assert {lag for item in others for _, lag in item.lags} == set(range(1, lags + 1))


@pytest.mark.parametrize("name", LIBRARIES)
@pytest.mark.parametrize(("degree", "lags", "inputs"), [(1, 2, 1), (3, 3, 1), (2, 4, 2), (4, 2, 3)])
def test_a_library_has_as_many_candidates_as_it_counts_before(name, degree, lags, inputs):
    made = candidates(name, degree, lags, inputs)
    assert len(made) == len(set(made)) == LIBRARIES[name].count(degree, lags, inputs)
    assert list(made) == canonical_order(made)


def test_the_polynomial_library_is_the_full_set():
    assert len(candidates("polynomial", 3, 3, 1)) == full_set(3, 3, 3) == 84


def test_the_defaults_are_those_of_the_documentation():
    phi, polynomial = LIBRARIES["phi-polynomial"], LIBRARIES["polynomial"]
    assert (phi.degree, phi.lags, phi.constraints) == (5, 3, "hysteresis")
    assert (polynomial.degree, polynomial.lags, polynomial.constraints) == (3, 3, "none")
    assert len(candidates("phi-polynomial", phi.degree, phi.lags, 1)) == 1 + 6 * comb(4 + 2, 2)


def test_every_candidate_is_a_product_of_the_paper_s_functions():
    made = candidates("phi-polynomial", 3, 3, 1)
    used = {node.primitive.name for item in made for node in _applied(item.expression)}
    assert used == {"mul", "sub", "sign"}


def _applied(expression):
    if isinstance(expression, Apply):
        yield expression
        for argument in expression.arguments:
            yield from _applied(argument)


# What is refused.


@pytest.mark.parametrize(("degree", "lags"), [(0, 1), (1, 0), (-1, 3)])
def test_degree_and_lags_are_at_least_one(degree, lags):
    with pytest.raises(SettingsError) as caught:
        candidates("polynomial", degree, lags, 1)
    assert str(caught.value) == f"degree and lags are at least 1, got {degree} and {lags}"


def test_a_first_difference_takes_two_lags():
    with pytest.raises(SettingsError, match="needs lags of at least 2: a first difference reads two samples"):
        candidates("phi-polynomial", 2, 1, 1)


def test_a_library_that_is_too_large_is_refused_before_it_is_made():
    with pytest.raises(SettingsError) as caught:
        candidates("polynomial", 5, 11, 1)
    assert str(caught.value) == (
        "80730 candidates are more than a library may have (4000): take a smaller degree or fewer lags, or "
        "let evolution search"
    )
    with pytest.raises(SettingsError, match=r"^[0-9]{30,} candidates are more"):
        candidates("polynomial", 40, 40, 3)
    with pytest.raises(SettingsError, match=r"^[0-9]{30,} candidates are more"):
        candidates("phi-polynomial", 500, 1_000_000, 9)


def test_what_counts_is_the_library_and_not_the_full_set():
    # 435 897 monomials of degree 5 in 16 + 16 lags, of which phi-polynomial has a hundredth.
    assert full_set(5, 16, 16) == 435_897
    assert len(candidates("phi-polynomial", 5, 16, 1)) == 1 + 15 * 16 * 15 == 3601 <= MAX_CANDIDATES


@pytest.mark.parametrize("ask", [library_named, lambda name: candidates(name, 2, 2, 1)])
def test_an_unknown_library_is_refused_with_what_there_is(ask):
    with pytest.raises(SettingsError) as caught:
        ask("wavelets")
    assert str(caught.value) == "unknown library 'wavelets': take one of phi-polynomial, polynomial"
