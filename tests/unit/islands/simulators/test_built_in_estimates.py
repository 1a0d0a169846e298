"""Built-in simulators: their outputs, the places of effects, and documents of earlier versions."""

import json
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.errors import ModelError
from islands.expressions.tree import Symbol
from islands.records.dataset import Dataset
from islands.simulators.built_in_estimates import SecondOrder, estimate_second_order
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.ode.simulator import OdeSimulator, make_ode_simulator
from islands.simulators.ode.system import OdeEffect
from islands.simulators.specification.description import describe_extension
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LocalExtendedSpec, PhysicalSpec
from islands.systems.bouc_wen import BoucWenPiezo
from islands.systems.bouc_wen import simulate as simulate_piezo
from support.built_in_simulators import make_oscillator, make_piezo, make_tanks
from support.simulated_records import made, recorded, simulate_oscillator, wave
from support.strategies import part_of_the_examples

Array = NDArray[np.float64]

#: Constants and initial levels of the tanks.
TANKS = {"k1": 0.5, "k2": 0.4, "k3": 0.3}
LEVELS = (4.0, 5.0)

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


def extend(simulator: OdeSimulator, u: Array, dt: float = 0.01, steps: int = 1) -> ExtendedSimulator:
    record = Dataset(u, u, dt, ("u_V",), output_name="y_V", input_units=("V",), output_unit="V")
    resampled = ResampledSimulator(simulator, InterSample.FOH, steps)
    return ExtendedSimulator(resampled, (), make_context(record, simulator, record.samples))


def simulate_tanks(u: Array, dt: float, rim: float = np.inf, caught: float = 0.0) -> Array:
    """Return the lower level by the midpoint rule with small steps; the upper tank overflows at ``rim``."""
    steps = 50
    pumped = np.interp((np.arange(u.size * steps) + 0.5) / steps, np.arange(u.size), u)
    k1, k2, k3 = TANKS.values()
    upper, lower = LEVELS
    levels = []
    for k, inflow in enumerate((k3 * pumped).tolist()):
        if k % steps == 0:
            levels.append(lower)
        h = dt / steps
        q1, q2 = k1 * upper**0.5, k2 * lower**0.5
        middle = upper + h / 2 * (inflow - q1), lower + h / 2 * (q1 - q2)
        q1, q2 = k1 * middle[0] ** 0.5, k2 * middle[1] ** 0.5
        upper, lower = upper + h * (inflow - q1), lower + h * (q1 - q2)
        lower += caught * max(upper - rim, 0.0)
        upper = min(upper, rim)
    return np.array(levels)


def test_an_oscillator_has_the_exact_motion_within_the_integration_error() -> None:
    u = wave()
    simulation = extend(make_oscillator(0.5, 4.0, 200.0), u, steps=8)
    exact = simulate_oscillator(u, 0.5, 4.0, 200.0)
    assert simulation.simulate(simulation.nominal) == pytest.approx(exact, abs=1e-6 * np.ptp(exact))


def test_tanks_have_the_levels_of_a_fine_integration() -> None:
    u = 3.0 + wave() / 25
    simulation = extend(make_tanks(**TANKS, levels=LEVELS), u, 0.5)
    expected = simulate_tanks(u, 0.5)
    assert simulation.simulate(simulation.nominal) == pytest.approx(expected, abs=1e-4 * np.ptp(expected))


def test_a_piezo_has_the_output_of_equation_11() -> None:
    u = wave()
    simulation = extend(make_piezo(), u)
    expected = simulate_piezo(BoucWenPiezo(), u, 0.01)
    assert simulation.simulate(simulation.nominal) == pytest.approx(expected, abs=1e-9)


def test_a_part_of_the_overflow_enters_the_lower_tank() -> None:
    u = 3.0 + wave() / 25
    simulation = extend(make_tanks(**TANKS, levels=LEVELS), u, 0.5, steps=16)
    for caught in (0.0, 0.6):
        clip = {"state-clip:upper": 4.2, "state-clip:upper caught": caught}
        expected = simulate_tanks(u, 0.5, 4.2, caught)
        assert simulation.simulate(simulation.nominal, clip) == pytest.approx(expected, abs=0.02)
        assert np.max(np.abs(expected - simulate_tanks(u, 0.5))) > 0.2


def test_every_effect_on_a_piezo_matches_the_reference_solution() -> None:
    dt = 0.01
    t = dt * np.arange(600)
    u = 20 * np.sin(3 * t) + 5 * np.cos(7.3 * t)
    A, beta, gamma, leak, rate, asymmetry = 0.8, 0.04, -0.01, 0.5, 2e-3, 0.01
    h, known = 0.0, []
    for k in range(t.size):
        known.append(h)
        if k + 1 < t.size:
            v = (u[k + 1] - u[k]) / dt
            faster = 1.0 + rate * abs(v)

            def slope(_s, h, v=v, faster=faster):
                return (
                    A * v
                    - beta * faster * abs(v) * h
                    - gamma * faster * v * np.abs(h)
                    - leak * h
                    - asymmetry * abs(v) * np.abs(h)
                )

            h = float(scipy.integrate.solve_ivp(slope, (0, dt), [h], rtol=1e-9, atol=1e-11).y[0, -1])
    simulation = extend(make_piezo(A=A, beta=beta, gamma=gamma, dp=1.0), u)
    effects = {"relaxation": leak, "rate-dependent-loop": rate, "loop-asymmetry": asymmetry}
    found = u - simulation.simulate(simulation.nominal, effects)
    # The equation has a kink within a step in which h changes sign.
    assert found == pytest.approx(np.array(known), abs=5e-4)
    assert np.max(np.abs(found)) > 5.0


#: Effects of extended simulations of earlier versions.
OLD_EFFECTS: dict[str, dict[str, dict[str, float]]] = {
    "second-order": {"input-offset:force": {"input-offset:force": 3.0}},
    "bouc-wen-piezo": {"relaxation": {"relaxation": 0.2}, "viscous": {"c": 0.01}},
    "cascaded-tanks": {
        "state-clip:lower": {"state-clip:lower": 5.2, "state-clip:lower caught": 0.0},
        "input-offset:upper": {"input-offset:upper": 0.3},
        "outflow-law:lower": {"outflow-law:lower": 0.1},
    },
}


@pytest.mark.parametrize("name", OLD_EFFECTS)
def test_an_extended_simulation_of_an_earlier_version_is_read(name: str) -> None:
    case = made()[name]
    assert isinstance(case.spec, PhysicalSpec)
    frame = {"unit": "m", "peak": 1.0, "rate": 1.0, "force_unit": "N", "force": 1.0}
    document: dict[str, Any] = {
        "schema": "islands.extended/1",
        "inputs": list(case.record.input_names),
        "output": case.record.output_name,
        "core": {"kind": name, "parameters": dict(case.spec.parameters)},
        "effects": [
            {"name": effect, "parameters": {key: {"value": value} for key, value in values.items()}}
            for effect, values in OLD_EFFECTS[name].items()
        ],
        "scales": {
            "dt": case.record.dt,
            "input_peak": 40.0,
            "output_peak": 40.0,
            "fitted_s": 4.5,
            "duration_s": 6.0,
            "frame": {**frame, "sense": -1.0, "dissipates": False, "sharp": 0.02},
        },
    }
    spec = LocalExtendedSpec.model_validate(json.loads(json.dumps(document)))
    simulator = make_simulator(spec, case.record)
    assert simulator.name == " + ".join([name, *OLD_EFFECTS[name]])
    alone = simulate_spec(spec.core, case.record)
    assert np.max(np.abs(simulate_spec(spec, case.record) - alone)) > 1e-3


def test_an_effect_that_does_not_exist_is_refused() -> None:
    effect = OdeEffect("leakage", "v", Symbol("value"))
    system = replace(make_oscillator(0.5, 4.0, 200.0).system, effects=(effect,))
    with pytest.raises(ModelError, match="leakage: there is no such effect: take input-offset"):
        make_ode_simulator(system, recorded(wave(), wave(), units=("N", "m")), {"x": 0.0, "v": 0.0})


def test_extended_tanks_start_from_estimated_levels_on_other_records() -> None:
    """From an empty upper tank, whose outflow has no derivative there, its level would not be found."""
    u = 3.0 + wave() / 25
    levels = simulate_tanks(u, 0.5)
    record = Dataset(u, levels, 0.5, ("u_V",), output_name="y_V", input_units=("V",), output_unit="V")
    tanks = make_simulator(PhysicalSpec(kind="cascaded-tanks", parameters=TANKS), record)
    assert isinstance(tanks, OdeSimulator)
    extended = make_ode_simulator(tanks.system.with_term("lower", "0*u"), record)
    values = np.array([each.nominal for each in extended.parameters])
    spec = describe_extension(extended, values, ("u_V",), "y_V")
    assert simulate_spec(spec, record) == pytest.approx(levels, abs=1e-3)


def make_input() -> Array:
    walk = np.cumsum(np.random.default_rng(3).standard_normal(SAMPLES))
    return walk - walk.mean()


def make_system(hertz: float, damping_ratio: float, m: float, x0: float, v0: float) -> SecondOrder:
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
    truth, u = make_system(*system), make_input()
    assert_close(estimate_second_order(u, simulate(truth, u), DT, {}), truth)


GIVEN = [names for count in (1, 2, 3) for names in combinations("mck", count)]


@pytest.mark.ci
@pytest.mark.parametrize("names", GIVEN, ids="".join)
def test_given_parameters_are_kept_and_the_others_recovered(names: tuple[str, ...]) -> None:
    truth, u = make_system(3.0, 0.08, 0.4, 0.5, -0.7), make_input()
    values = {"m": truth.mass, "c": truth.damping, "k": truth.stiffness}
    chosen = {name: values[name] for name in names}
    found = estimate_second_order(u, simulate(truth, u), DT, chosen)
    assert_close(found, truth)
    kept = {"m": found.mass, "c": found.damping, "k": found.stiffness}
    assert {name: kept[name] for name in names} == chosen


def test_estimate_from_a_noisy_record_is_within_one_per_cent() -> None:
    truth, u = make_system(3.0, 0.08, 0.4, 0.5, -0.7), make_input()
    y = simulate(truth, u)
    noisy = y + 0.01 * y.std() * np.random.default_rng(4).standard_normal(y.size)
    assert_close(estimate_second_order(u, noisy, DT, {}), truth, rel=0.01)
