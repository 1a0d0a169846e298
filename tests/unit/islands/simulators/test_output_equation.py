"""Equation of the output: without terms it is that of the simulation, with terms it is as written."""

from collections.abc import Mapping

import numpy as np
import pytest

from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.interface import SimulationRun
from islands.simulators.ode.system import OUTPUT, OdeParameter
from islands.simulators.output_equation import OutputEquation, add_output_equation

DT = 0.1


def first_order(u: Signal, dt: float, tau: float = 0.5) -> Signal:
    y = np.zeros_like(u)
    for k in range(1, u.size):
        y[k] = y[k - 1] + dt / tau * (u[k - 1] - y[k - 1])
    return y


def make_record(segments: tuple[int, ...] = ()) -> Dataset:
    u = np.random.default_rng(3).standard_normal(200).cumsum()
    return Dataset(u, first_order(u, DT), DT, ("u",), segments=segments)


def make_equation(record: Dataset, terms: Mapping[str, float]) -> tuple[OutputEquation, ExtendedSimulator]:
    """Return the equation with a coefficient for each term, and the simulation of a record."""
    simulator = PythonFunctionSimulator(first_order, "first_order")
    context = make_context(record, simulator, 150)
    found = add_output_equation(simulator, context)
    system = found.system
    for number, (text, coefficient) in enumerate(terms.items(), start=1):
        parameter = OdeParameter(f"a{number}", coefficient, lower=-9.0, upper=9.0)
        system = system.with_term(OUTPUT, f"a{number}*({text})", [parameter])
    found = OutputEquation(simulator, system, found.sizes)
    return found, ExtendedSimulator(found, (), context)


def test_simulation_is_unchanged_without_terms() -> None:
    record = make_record()
    _, simulation = make_equation(record, {})
    np.testing.assert_array_equal(simulation.simulate(simulation.nominal), first_order(record.u[:, 0], DT))


def test_terms_read_the_input_the_simulated_output_and_the_time() -> None:
    record = make_record()
    terms = {"rate(u)*abs(u)": 0.5, "y_sim**3": -0.2, "t": 0.01}
    _, simulation = make_equation(record, terms)
    u = record.u[:, 0]
    y = first_order(u, DT)
    expected = y + 0.5 * np.gradient(u, DT) * np.abs(u) - 0.2 * y**3 + 0.01 * DT * np.arange(u.size)
    np.testing.assert_allclose(simulation.simulate(simulation.nominal), expected, rtol=1e-12)


def test_rate_does_not_reach_from_one_recording_into_the_next() -> None:
    record = make_record((120, 80))
    _, simulation = make_equation(record, {"rate(u)": 1.0})
    for part, piece in zip(np.split(record.u[:, 0], [120]), simulation.parts, strict=True):
        expected = first_order(part, DT) + np.gradient(part, DT)
        np.testing.assert_allclose(piece.simulate(piece.nominal), expected, rtol=1e-12)


def test_runs_that_differ_only_in_the_equation_share_a_simulation() -> None:
    calls = []

    def count(u: Signal, dt: float, tau: float = 0.5) -> Signal:
        calls.append(tau)
        return first_order(u, dt, tau)

    record = make_record()
    equation, simulation = make_equation(record, {"u": 1.0, "u**2": 1.0})
    counted = OutputEquation(PythonFunctionSimulator(count, "count"), equation.system, equation.sizes)
    u = simulation.context.u
    points = [(0.5, 0.1, 0.0), (0.5, 0.2, 0.3), (0.4, 0.1, 0.0)]
    runs = [SimulationRun(np.array(point), u, {}, ()) for point in points]
    outputs = counted.simulate_batch(runs, simulation.context)
    assert calls == [0.5, 0.4]
    for output, (tau, first, second) in zip(outputs, points, strict=True):
        np.testing.assert_allclose(output, first_order(u, DT, tau) + first * u + second * u**2, rtol=1e-12)


def test_own_values_are_the_last_ones() -> None:
    equation, _ = make_equation(make_record(), {"u": 1.0})
    changed = equation.with_values(np.array([0.7, 2.5]))
    assert [(each.name, each.nominal) for each in changed.parameters] == [
        ("tau", 0.5),
        ("a1", pytest.approx(2.5)),
    ]
