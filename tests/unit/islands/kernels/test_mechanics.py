"""Force elements along a motion and in a balance of forces, compared with formulas and a reference solver."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.effects import hysteresis
from islands.kernels.mechanics import WIDTH, Elements, compile_law, integrate_along
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import generate_program
from islands.simulators.ode.sampled_signal import SampledSignal
from islands.simulators.ode.shooting import IntervalSimulation
from islands.simulators.ode.system_document import make_system

pytestmark = pytest.mark.ci

Array = NDArray[np.float64]

#: Mass of the oscillator.
MASS = 0.5

#: Damping of the oscillator.
DAMPING = 1.2

#: Stiffness of the oscillator.
STIFFNESS = 80.0


#: Balance of forces.
MOTION = make_system(
    {
        "name": "motion",
        "input": "F",
        "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x - force)/m",
        "output": "x",
        "parameters": {"m": MASS, "c": DAMPING, "k": STIFFNESS},
        "force": {"coordinate": "x", "rate": "v"},
    }
)


def cubic(x, _rate, _z, numbers):
    return numbers[0] * x * x * x


def drag(_x, rate, _z, numbers):
    return numbers[0] * rate


def state_force(_x, _rate, z, numbers):
    return numbers[0] * z


def leaky_integral(x, rate, z, numbers):
    return rate - numbers[1] * z - numbers[2] * x * z


def elements(*parts) -> Elements:
    """Pack elements (force, state derivative or None, sign, initial state, numbers)."""
    numbers = np.zeros((len(parts), WIDTH))
    for row, part in zip(numbers, parts, strict=True):
        row[: len(part[4])] = part[4]
    return Elements(
        np.array([compile_law(part[0]).address for part in parts], dtype=np.int64),
        np.array([compile_law(part[1]).address if part[1] else 0 for part in parts], dtype=np.int64),
        np.array([part[2] for part in parts], dtype=float),
        np.array([part[3] for part in parts], dtype=float),
        numbers,
    )


def input_force(t: Array | float) -> Array:
    return 3.0 * np.sin(7.0 * t) + 2.0 * np.cos(3.1 * t)


def simulate(
    parts: Elements,
    dt: float,
    seconds: float = 4.0,
    u: Callable[[Array], Array] = input_force,
    start: tuple[float, float] = (0.0, 0.0),
    interval: int = 0,
    restart: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Integrate the motion, with restarts from a state after each interval, in samples."""
    t = dt * np.arange(round(seconds / dt) + 1)
    lane = LaneInput(
        {"m": MASS, "c": DAMPING, "k": STIFFNESS},
        dict(zip("xv", start, strict=True)),
        {"F": SampledSignal.join(u(t), u(t + dt / 2), u(t + dt))},
        parts if parts.forces.size else None,
    )
    program = generate_program(MOTION, laws=parts.forces.size)
    if not interval:
        return simulate_lanes(program, dt, [lane])[0, 0]
    states = np.array([[start, *[restart] * (-(-t.size // interval) - 1)]])
    simulation = IntervalSimulation(program, dt, [lane], "xv", interval)
    found = simulation.simulate(np.array([0]), states, np.ones(states.shape[:2], dtype=bool))
    return found[0, 0].reshape(-1)[: t.size]


def reference(
    force: Callable[..., float], derivative: Callable[..., float] | None, z0: float, dt: float
) -> Array:
    """Integrate by a SciPy method of high order; the force opposes the motion."""

    def slope(t, state):
        x, v, z = state
        return [
            v,
            (input_force(t) - DAMPING * v - STIFFNESS * x - force(x, v, z)) / MASS,
            derivative(x, v, z) if derivative else 0.0,
        ]

    t = dt * np.arange(round(4.0 / dt) + 1)
    found = scipy.integrate.solve_ivp(
        slope, (0.0, t[-1]), [0.0, 0.0, z0], "DOP853", t, rtol=1e-10, atol=1e-13, max_step=5e-3
    )
    return found.y[0]


def test_linear_oscillator_matches_reference_solution() -> None:
    assert simulate(elements(), 2e-3) == pytest.approx(reference(lambda *_: 0.0, None, 0.0, 2e-3), abs=1e-8)


def test_hysteresis_element_matches_reference_solution() -> None:
    form, numbers = hysteresis.SECOND_HYSTERESIS.form, (60.0, 40.0, -15.0, 0.01)
    parts = elements((form.force, form.state_derivative, -1.0, 0.01, numbers))
    known = reference(
        lambda _x, _v, z: numbers[0] * z,
        lambda _x, v, z: v - numbers[1] * abs(v) * z - numbers[2] * v * abs(z),
        0.01,
        2e-3,
    )
    # The element's equation has a kink when the rate changes sign, so one step loses its order.
    assert simulate(parts, 2e-3) == pytest.approx(known, abs=2e-6)
    assert np.max(np.abs(known - simulate(elements(), 2e-3))) > 0.005


def test_halving_the_step_divides_the_motion_error_by_sixteen() -> None:
    parts = elements((cubic, None, -1.0, 0.0, (4e4,)), (drag, None, -1.0, 0.0, (0.4,)))
    fine = simulate(parts, 1.25e-3)
    errors = [
        float(np.max(np.abs(simulate(parts, dt) - fine[:: round(dt / 1.25e-3)]))) for dt in (0.02, 0.01)
    ]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)


def motion() -> tuple[Array, Array, float]:
    t = 0.01 * np.arange(300)
    x = np.sin(5 * t) + 0.3 * np.cos(11 * t)
    return x, np.gradient(x, 0.01), 0.01


def test_element_state_along_a_motion_matches_reference_solution() -> None:
    x, rate, dt = motion()
    found = np.empty((1, x.size))
    integrate_along(x, rate, dt, elements((state_force, leaky_integral, 1.0, 0.4, (1.0, 2.0, 0.5))), found)
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
    assert found[0] == pytest.approx(np.array(known), abs=1e-7)


def test_only_laws_of_the_package_are_loaded_from_the_cache_folder() -> None:
    """The name of the folder depends on the sources of the package alone."""
    compile_law.__wrapped__(hysteresis.SECOND_HYSTERESIS.form.force)
    assert compile_law.__wrapped__(hysteresis.SECOND_HYSTERESIS.form.force).cache_hits == 1
    compile_law.__wrapped__(state_force)
    assert compile_law.__wrapped__(state_force).cache_hits == 0


@pytest.mark.parametrize("ratio", [-50.0, -1.2, 0.0, 0.8, 50.0])
@pytest.mark.parametrize("chi", [0.3, 3.0])
def test_second_hysteresis_dissipates(chi: float, ratio: float) -> None:
    """Without dissipation, its curve would be that of a spring: a tanh, or a power."""
    angle = np.linspace(0.0, 8.0 * np.pi, 4001)
    x, dt = np.sin(angle), float(angle[1])
    form = hysteresis.SECOND_HYSTERESIS.form
    z = np.empty((1, x.size))
    law = (form.force, form.state_derivative, 1.0, 0.0, (1.0, chi, ratio * chi, 0.0))
    integrate_along(x, np.cos(angle), dt, elements(law), z)
    period = slice(-1001, None)
    loop = float(np.trapezoid(z[0, period], x[period]))
    assert loop > 0.05 * float(np.ptp(z[0, period]) * np.ptp(x[period]))
