"""Estimation of a second-order system from a record."""

from itertools import combinations

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.simulators.second_order import SecondOrder, estimate_second_order
from support.strategies import part_of_the_examples

Array = NDArray[np.float64]

#: Length of the records in samples.
SAMPLES = 400

#: Sampling time in seconds.
DT = 0.01

#: Natural frequency in Hz, damping ratio, mass, and the initial state relative to the response to the input.
systems = st.tuples(
    st.floats(0.8, 12.0),
    st.floats(0.01, 0.9),
    st.sampled_from([1e-3, 0.7, 400.0]),
    st.floats(-1, 1),
    st.floats(-1, 1),
)


def make_input() -> Array:
    walk = np.cumsum(np.random.default_rng(3).standard_normal(SAMPLES))
    return walk - walk.mean()


def make_oscillator(hertz: float, damping_ratio: float, m: float, x0: float, v0: float) -> SecondOrder:
    frequency = 2 * np.pi * hertz
    k = m * frequency**2
    size = 5.0 / k
    return SecondOrder(m, 2 * damping_ratio * frequency * m, k, x0 * size, v0 * size * frequency)


def simulate(truth: SecondOrder, u: Array) -> Array:
    """Solve the equation exactly for a linearly interpolated input."""
    equation = np.array([[0, 1], [-truth.stiffness / truth.mass, -truth.damping / truth.mass]])
    state = (equation, np.array([[0], [1 / truth.mass]]), np.array([[1, 0]]), np.zeros((1, 1)))
    _, y, _ = scipy.signal.lsim(state, u, DT * np.arange(u.size), X0=[truth.position, truth.rate])
    return np.asarray(y).ravel()


def assert_close(found: SecondOrder, truth: SecondOrder, rel: float = 1e-5) -> None:
    frequency = (truth.stiffness / truth.mass) ** 0.5
    size = 5.0 / truth.stiffness
    assert found.mass == pytest.approx(truth.mass, rel=rel)
    assert found.damping == pytest.approx(truth.damping, rel=rel)
    assert found.stiffness == pytest.approx(truth.stiffness, rel=rel)
    assert found.position == pytest.approx(truth.position, abs=rel * size)
    assert found.rate == pytest.approx(truth.rate, abs=rel * size * frequency)


@pytest.mark.ci
@part_of_the_examples(10)
@given(systems)
def test_estimate_recovers_the_system_of_a_record(system: tuple[float, float, float, float, float]) -> None:
    truth, u = make_oscillator(*system), make_input()
    assert_close(estimate_second_order(u, simulate(truth, u), DT, {}), truth)


GIVEN = [names for count in (1, 2, 3) for names in combinations("mck", count)]


@pytest.mark.ci
@pytest.mark.parametrize("names", GIVEN, ids="".join)
def test_given_parameters_are_kept_and_the_others_recovered(names: tuple[str, ...]) -> None:
    truth, u = make_oscillator(3.0, 0.08, 0.4, 0.5, -0.7), make_input()
    values = {"m": truth.mass, "c": truth.damping, "k": truth.stiffness}
    chosen = {name: values[name] for name in names}
    found = estimate_second_order(u, simulate(truth, u), DT, chosen)
    assert_close(found, truth)
    kept = {"m": found.mass, "c": found.damping, "k": found.stiffness}
    assert {name: kept[name] for name in names} == chosen


@pytest.mark.parametrize("name", ["c", "k"])
def test_given_zero_does_not_determine_the_scale(name: str) -> None:
    """Estimate the mass without a damper and without a spring."""
    u = make_input()
    known = {"m": 0.4, "c": 1.5, "k": 140.0, name: 0.0}
    truth = SecondOrder(known["m"], known["c"], known["k"])
    found = estimate_second_order(u, simulate(truth, u), DT, {name: 0.0})
    assert (found.mass, found.damping, found.stiffness) == pytest.approx(
        (truth.mass, truth.damping, truth.stiffness), rel=1e-4
    )


def test_estimate_from_a_noisy_record_is_within_one_per_cent() -> None:
    truth, u = make_oscillator(3.0, 0.08, 0.4, 0.5, -0.7), make_input()
    y = simulate(truth, u)
    noisy = y + 0.01 * y.std() * np.random.default_rng(4).standard_normal(y.size)
    assert_close(estimate_second_order(u, noisy, DT, {}), truth, rel=0.01)
