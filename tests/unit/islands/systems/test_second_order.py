"""A second-order system estimated from a record is the one that made it."""

from itertools import combinations

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.systems.second_order import SecondOrder, estimate_second_order
from support.strategies import part_of_the_examples

Array = NDArray[np.float64]

SAMPLES, DT = 400, 0.01

#: Natural frequency in Hz, part of the critical damping, mass, and the state at the first sample: in parts
#: of what the input moves.
systems = st.tuples(
    st.floats(0.8, 12.0),
    st.floats(0.01, 0.9),
    st.sampled_from([1e-3, 0.7, 400.0]),
    st.floats(-1, 1),
    st.floats(-1, 1),
)


def pushed() -> Array:
    walk = np.cumsum(np.random.default_rng(3).standard_normal(SAMPLES))
    return walk - walk.mean()


def oscillator(hertz: float, part: float, m: float, x0: float, v0: float) -> SecondOrder:
    usual = 2 * np.pi * hertz
    k = m * usual**2
    size = 5.0 / k
    return SecondOrder(m, 2 * part * usual * m, k, x0 * size, v0 * size * usual)


def moved(truth: SecondOrder, u: Array) -> Array:
    """Solve the equation exactly, the input running straight from sample to sample."""
    equation = np.array([[0, 1], [-truth.stiffness / truth.mass, -truth.damping / truth.mass]])
    state = (equation, np.array([[0], [1 / truth.mass]]), np.array([[1, 0]]), np.zeros((1, 1)))
    _, y, _ = scipy.signal.lsim(state, u, DT * np.arange(u.size), X0=[truth.position, truth.rate])
    return np.asarray(y).ravel()


def same(found: SecondOrder, truth: SecondOrder, rel: float = 1e-5) -> None:
    usual = (truth.stiffness / truth.mass) ** 0.5
    size = 5.0 / truth.stiffness
    assert found.mass == pytest.approx(truth.mass, rel=rel)
    assert found.damping == pytest.approx(truth.damping, rel=rel)
    assert found.stiffness == pytest.approx(truth.stiffness, rel=rel)
    assert found.position == pytest.approx(truth.position, abs=rel * size)
    assert found.rate == pytest.approx(truth.rate, abs=rel * size * usual)


@part_of_the_examples(10)
@given(systems)
def test_what_made_a_record_is_found_again(system: tuple[float, float, float, float, float]) -> None:
    truth, u = oscillator(*system), pushed()
    same(estimate_second_order(u, moved(truth, u), DT, {}), truth)


GIVEN = [names for many in (1, 2, 3) for names in combinations("mck", many)]


@pytest.mark.parametrize("names", GIVEN, ids="".join)
def test_what_is_given_is_kept_and_the_rest_found(names: tuple[str, ...]) -> None:
    truth, u = oscillator(3.0, 0.08, 0.4, 0.5, -0.7), pushed()
    values = {"m": truth.mass, "c": truth.damping, "k": truth.stiffness}
    chosen = {name: values[name] for name in names}
    found = estimate_second_order(u, moved(truth, u), DT, chosen)
    same(found, truth)
    kept = {"m": found.mass, "c": found.damping, "k": found.stiffness}
    assert {name: kept[name] for name in names} == chosen


@pytest.mark.parametrize("names", ["m", "c", "k"])
def test_what_is_given_is_kept_where_it_is_wrong(names: str) -> None:
    truth, u = oscillator(3.0, 0.08, 0.4, 0.5, -0.7), pushed()
    wrong = {"m": 1.3 * truth.mass, "c": 0.6 * truth.damping, "k": 1.2 * truth.stiffness}
    chosen = {name: wrong[name] for name in names}
    found = estimate_second_order(u, moved(truth, u), DT, chosen)
    kept = {"m": found.mass, "c": found.damping, "k": found.stiffness}
    assert {name: kept[name] for name in names} == chosen


@pytest.mark.parametrize("name", ["c", "k"])
def test_a_zero_that_is_given_says_nothing_of_the_size(name: str) -> None:
    """Without a damper, and without a spring: the mass is found all the same."""
    u = pushed()
    known = {"m": 0.4, "c": 1.5, "k": 140.0, name: 0.0}
    truth = SecondOrder(known["m"], known["c"], known["k"])
    found = estimate_second_order(u, moved(truth, u), DT, {name: 0.0})
    assert (found.mass, found.damping, found.stiffness) == pytest.approx(
        (truth.mass, truth.damping, truth.stiffness), rel=1e-4
    )


def test_a_mass_of_zero_is_refused() -> None:
    u = pushed()
    with pytest.raises(SettingsError, match="a mass of zero"):
        estimate_second_order(u, u, DT, {"m": 0.0})


def test_the_state_at_the_first_sample_knows_nothing_of_what_was_before() -> None:
    """The input begins at a value of its own: before the first sample there is none."""
    truth, u = oscillator(1.0, 0.2, 2.0, 0.0, 0.0), 30.0 + pushed()
    found = estimate_second_order(u, moved(truth, u), DT, {})
    size = 30.0 / truth.stiffness
    assert found.position == pytest.approx(0.0, abs=1e-6 * size)
    assert found.rate == pytest.approx(0.0, abs=1e-5 * size)


def test_noise_moves_it_by_as_much_as_it_has_to() -> None:
    truth, u = oscillator(3.0, 0.08, 0.4, 0.5, -0.7), pushed()
    y = moved(truth, u)
    noisy = y + 0.01 * y.std() * np.random.default_rng(4).standard_normal(y.size)
    same(estimate_second_order(u, noisy, DT, {}), truth, rel=0.01)
