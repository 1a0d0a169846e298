"""Elements along a motion and in a balance of forces, beside formulas and another integrator."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.discrepancy.effects import hysteresis
from islands.systems.mechanics import WIDTH, Elements, compiled, integrate_along, integrate_motion

Array = NDArray[np.float64]

#: Of the oscillator.
MASS, DAMPING, STIFFNESS = 0.5, 1.2, 80.0


def cubic(x, _rate, _z, numbers):
    return numbers[0] * x * x * x


def drag(_x, rate, _z, numbers):
    return numbers[0] * rate


def stored(_x, _rate, z, numbers):
    return numbers[0] * z


def travelled(_x, rate, _z, _numbers):
    return rate


def leaking(x, rate, z, numbers):
    return rate - numbers[1] * z - numbers[2] * x * z


def elements(*parts) -> Elements:
    """Return elements of (force, memory or None, sign, state at the beginning, numbers)."""
    numbers = np.zeros((len(parts), WIDTH))
    for row, part in zip(numbers, parts, strict=True):
        row[: len(part[4])] = part[4]
    return Elements(
        np.array([compiled(part[0]).address for part in parts], dtype=np.int64),
        np.array([compiled(part[1]).address if part[1] else 0 for part in parts], dtype=np.int64),
        np.array([part[2] for part in parts], dtype=float),
        np.array([part[3] for part in parts], dtype=float),
        numbers,
    )


def push(t: Array | float) -> Array:
    return 3.0 * np.sin(7.0 * t) + 2.0 * np.cos(3.1 * t)


def moved(
    parts: Elements,
    dt: float,
    seconds: float = 4.0,
    u: Callable[[Array], Array] = push,
    starts: dict[int, tuple[float, float]] | None = None,
) -> Array:
    """Integrate from rest, or from states at some samples."""
    t = dt * np.arange(round(seconds / dt) + 1)
    begins, x0, v0, x = np.zeros(t.size, dtype=bool), np.zeros(t.size), np.zeros(t.size), np.empty(t.size)
    begins[0] = True
    for k, (position, rate) in (starts or {}).items():
        begins[k], x0[k], v0[k] = True, position, rate
    midway = np.stack([u(t + dt / 2), u(t + dt)])
    integrate_motion(u(t), midway, dt, MASS, DAMPING, STIFFNESS, parts, begins, x0, v0, x)
    return x


def reference(
    force: Callable[..., float], memory: Callable[..., float] | None, z0: float, dt: float
) -> Array:
    """Integrate by somebody else's method of high order; the force resists."""

    def slope(t, state):
        x, v, z = state
        return [
            v,
            (push(t) - DAMPING * v - STIFFNESS * x - force(x, v, z)) / MASS,
            memory(x, v, z) if memory else 0.0,
        ]

    t = dt * np.arange(round(4.0 / dt) + 1)
    found = scipy.integrate.solve_ivp(
        slope, (0.0, t[-1]), [0.0, 0.0, z0], "DOP853", t, rtol=1e-10, atol=1e-13, max_step=5e-3
    )
    return found.y[0]


def test_a_linear_oscillator_moves_as_it_has_to() -> None:
    assert moved(elements(), 2e-3) == pytest.approx(reference(lambda *_: 0.0, None, 0.0, 2e-3), abs=1e-8)


def test_so_does_one_with_a_cubic_spring() -> None:
    parts = elements((cubic, None, -1.0, 0.0, (4e4,)))
    known = reference(lambda x, _v, _z: 4e4 * x**3, None, 0.0, 2e-3)
    assert moved(parts, 2e-3) == pytest.approx(known, abs=1e-7)
    assert np.max(np.abs(known - moved(elements(), 2e-3))) > 0.01


def test_so_does_one_with_a_hysteresis() -> None:
    form, numbers = hysteresis.SECOND_HYSTERESIS.form, (60.0, 40.0, -15.0, 0.01)
    parts = elements((form.force, form.state_derivative, -1.0, 0.01, numbers))
    known = reference(
        lambda _x, _v, z: numbers[0] * z,
        lambda _x, v, z: v - numbers[1] * abs(v) * z - numbers[2] * v * abs(z),
        0.01,
        2e-3,
    )
    # Where the rate turns the element's law has a kink: the order is lost for a step.
    assert moved(parts, 2e-3) == pytest.approx(known, abs=2e-6)
    assert np.max(np.abs(known - moved(elements(), 2e-3))) > 0.005


def test_half_the_step_has_a_sixteenth_of_the_error() -> None:
    parts = elements((cubic, None, -1.0, 0.0, (4e4,)), (drag, None, -1.0, 0.0, (0.4,)))
    fine = moved(parts, 1.25e-3)
    errors = [float(np.max(np.abs(moved(parts, dt) - fine[:: round(dt / 1.25e-3)]))) for dt in (0.02, 0.01)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)


def test_a_sign_turns_a_force_round() -> None:
    """A spring that resists is one more spring."""
    stiffer = elements((spring, None, -1.0, 0.0, (STIFFNESS,)))
    softer = elements((spring, None, 1.0, 0.0, (-STIFFNESS,)))
    assert np.array_equal(moved(stiffer, 0.01), moved(softer, 0.01))


def spring(x, _rate, _z, numbers):
    return numbers[0] * x


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.1, 9.0))
def test_without_elements_it_is_linear(one: float, other: float, pitch: float) -> None:
    def second(t):
        return np.cos(pitch * t)

    parts = elements()
    together = moved(parts, 0.01, u=lambda t: one * push(t) + other * second(t))
    apart = one * moved(parts, 0.01) + other * moved(parts, 0.01, u=second)
    assert together == pytest.approx(apart, abs=1e-12)


def test_it_begins_anew_where_it_is_told() -> None:
    parts = elements((cubic, None, -1.0, 0.0, (4e4,)))
    whole = moved(parts, 0.01, starts={150: (0.03, -0.4)})
    assert whole[150] == 0.03
    assert np.array_equal(whole[:150], moved(parts, 0.01)[:150])
    later = moved(parts, 0.01, seconds=2.5, u=lambda t: push(t + 1.5), starts={0: (0.03, -0.4)})
    assert whole[150:] == pytest.approx(later, abs=1e-12)


def test_what_an_element_remembers_goes_on_through_a_beginning() -> None:
    """The stored travel is that of the whole motion: only so does the force behind the restart fit."""
    parts = elements((stored, travelled, -1.0, 0.0, (30.0,)))
    plain = moved(parts, 0.005)
    # It begins anew where it is and as fast as it moves: all but the rounding of the rate stays the same.
    t = 0.005 * np.arange(plain.size)
    rate = float(np.interp(1.0, t, np.gradient(plain, t)))
    again = moved(parts, 0.005, starts={200: (float(plain[200]), rate)})
    assert again == pytest.approx(plain, abs=1e-4)
    elsewhere = moved(parts, 0.005, starts={200: (float(plain[200]) + 0.02, rate)})
    # The travel does not know of the leap: the spring of it pulls to a place of its own from then on.
    known = 30.0 * 0.02 / (STIFFNESS + 30.0)
    assert (elsewhere - plain)[-100:].mean() == pytest.approx(known, rel=0.1)


def test_what_explodes_is_no_number_from_there_on() -> None:
    with np.errstate(all="ignore"):
        x = moved(elements((cubic, None, 1.0, 0.0, (1e9,))), 0.01)
    first = int(np.flatnonzero(~np.isfinite(x))[0])
    assert 0 < first < x.size
    assert np.isnan(x[first:]).all()


def motion() -> tuple[Array, Array, float]:
    t = 0.01 * np.arange(300)
    x = np.sin(5 * t) + 0.3 * np.cos(11 * t)
    return x, np.gradient(x, 0.01), 0.01


def test_along_a_motion_forces_are_their_formulas() -> None:
    x, rate, dt = motion()
    total = np.full(x.size, 7.0)
    parts = elements((cubic, None, 1.0, 0.0, (2.0,)), (drag, None, -1.0, 0.0, (0.7,)))
    integrate_along(x, rate, dt, parts, total)
    assert total == pytest.approx(2.0 * x**3 - 0.7 * rate, abs=1e-13)


def test_along_a_motion_nothing_is_nothing() -> None:
    x, rate, dt = motion()
    total = np.full(x.size, 7.0)
    integrate_along(x, rate, dt, elements(), total)
    assert not total.any()


def test_along_a_motion_what_is_remembered_is_integrated_from_its_beginning() -> None:
    x, rate, dt = motion()
    total = np.empty(x.size)
    integrate_along(x, rate, dt, elements((stored, travelled, 1.0, 0.4, (3.0,))), total)
    assert total == pytest.approx(3.0 * (0.4 + x - x[0]), abs=1e-12)


def test_along_a_motion_a_memory_is_the_solution_of_its_equation() -> None:
    x, rate, dt = motion()
    total = np.empty(x.size)
    integrate_along(x, rate, dt, elements((stored, leaking, 1.0, 0.4, (1.0, 2.0, 0.5))), total)
    z, known = 0.4, []
    for k in range(x.size):
        known.append(z)
        if k + 1 < x.size:
            slope = (x[k + 1] - x[k]) / dt
            step = scipy.integrate.solve_ivp(
                lambda s, z, k=k, slope=slope: slope - 2.0 * z - 0.5 * (x[k] + slope * s) * z,
                (0.0, dt),
                [z],
                rtol=1e-10,
                atol=1e-12,
            )
            z = float(step.y[0, -1])
    assert total == pytest.approx(np.array(known), abs=1e-7)
