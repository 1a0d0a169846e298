"""Equations of extended simulations: each effect is inserted where it acts."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.inference.finding import Finding, Value
from islands.effects.catalogue import CATALOGUE, catalogue_order
from islands.effects.interface.effect import Effect
from islands.effects.scale import wrong_parameter
from islands.records.dataset import Dataset
from islands.report.documents.extension import WrittenExtension, write_extended_equations
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.intersample import ResampledSimulator
from islands.simulators.output_equation import add_output_equation
from islands.simulators.specification.factory import make_simulator


class Fit:
    """Simulation and values of a calibration."""

    def __init__(self, simulation: ExtendedSimulator) -> None:
        self.simulation = simulation
        self.values = simulation.nominal + 0.3 * simulation.scales


def _make_record() -> Dataset:
    u = np.random.default_rng(0).standard_normal(300).cumsum()
    u += 1.0 - u.min()
    inputs = np.column_stack([u, 20.0 + 0.01 * np.arange(300), np.sin(np.arange(300))])
    return Dataset(inputs, 0.5 * u, 0.1, ("u_V", "T_K", "w_A"), "y_m", ("V", "K", "A"), "m")


RECORD = _make_record()


def write(
    simulation: str | Simulator, names: Sequence[str], findings: Sequence[Finding] = ()
) -> WrittenExtension:
    simulator = make_simulator(simulation, RECORD, {}) if isinstance(simulation, str) else simulation
    of_states = {effect.name: effect for effect in simulator.state_effects}
    parameters = {f"wrong-parameter:{each.name}": wrong_parameter(each) for each in simulator.parameters}
    known: dict[str, Effect] = {**CATALOGUE, **of_states, **parameters}
    context = make_context(RECORD, simulator, 200)
    extended = ExtendedSimulator(simulator, catalogue_order([known[name] for name in names]), context)
    return write_extended_equations(cast("CalibrationResult", Fit(extended)), findings, RECORD)


def texts(simulation: str | Simulator, *names: str) -> list[str]:
    return [line.text for line in write(simulation, names).lines]


def test_friction_and_a_delay_are_inserted_into_the_equation_of_motion() -> None:
    assert texts("second-order", "coulomb-friction", "delay") == [
        "dx/dt = v",
        "dv/dt = (u(t - tau) - c*v - k*x - F*sign(v))/m",
        "output = x",
    ]


def test_maps_of_an_actuator_are_written_in_the_order_in_which_they_act() -> None:
    maps = CATALOGUE["backlash"], CATALOGUE["dead-zone"]
    simulator = make_simulator("second-order", RECORD, {})
    context = make_context(RECORD, simulator, 200)
    written = []
    for effects in (maps, maps[::-1]):
        fit = cast("CalibrationResult", Fit(ExtendedSimulator(simulator, effects, context)))
        written.append([line.text for line in write_extended_equations(fit, (), RECORD).lines])
    assert written[0][0] == "u2 = play(u, b)"
    assert "dv/dt = (sign(u2)*max(abs(u2) - d, 0) - c*v - k*x)/m" in written[0]
    assert "dv/dt = (play(sign(u)*max(abs(u) - d, 0), b) - c*v - k*x)/m" in written[1]


def test_a_name_that_the_simulation_has_gets_a_number() -> None:
    lines = texts("second-order", "cubic-stiffness", "quadratic-drag")
    assert "dv/dt = (u - c*v - k*x - c2*abs(v)*v - k2*x**3)/m" in lines


def test_maps_of_the_output_act_one_after_the_other() -> None:
    assert texts("second-order", "sensor-lag", "output-saturation", "offset")[2:] == [
        "dy/dt = (x - y)/tau",
        "output = clip(y, -L, L) + c2",
    ]


def test_an_effect_with_a_memory_has_the_equation_of_its_state() -> None:
    lines = texts("second-order", "second-hysteresis")
    assert "dv/dt = (u - c*v - k*x - k2*z)/m" in lines
    assert "dz/dt = v - chi*abs(v)*z - g*v*abs(z)" in lines


def test_effects_on_states_and_parameters_are_in_their_equations() -> None:
    lines = texts("cascaded-tanks", "input-offset:lower", "state-clip:upper", "outflow-law:lower")
    assert "dlower/dt = q1 - q2 + k3*offset_lower" in lines
    assert "q2 = k2*sqrt(max(lower, 0)) + l_lower*max(lower, 0)" in lines
    assert "upper <= limit_upper" in lines
    assert "dv/dt = (u - c*v - k*(1 + r)*x)/m" in texts("second-order", "wrong-parameter:k")


def test_a_change_of_the_gain_multiplies_its_parameter_or_the_input() -> None:
    assert "output = dp*(1 + k*step(t - t0))*u - h" in texts("bouc-wen-piezo", "gain-step")
    assert "dv/dt = (u*(1 + k2*t/T) - c*v - k*x)/m" in texts("second-order", "ageing")


def test_an_input_that_is_read_twice_is_mapped_once() -> None:
    assert texts("bouc-wen-piezo", "dead-zone", "relaxation") == [
        "u2 = sign(u)*max(abs(u) - d, 0)",
        "w = rate(u2)",
        "dh/dt = A*w - beta*abs(w)*h - gamma*w*abs(h) - r*h",
        "output = dp*u2 - h",
    ]


@pytest.mark.parametrize("wrap", [lambda simulator: simulator, ResampledSimulator])
def test_a_simulation_without_equations_is_a_function_of_its_input(wrap: type[ResampledSimulator]) -> None:
    simulator = wrap(make_simulator("linear:1", RECORD, {}))
    written = write(simulator, ["dead-zone", "delay", "coulomb-friction", "offset"])
    assert [line.text for line in written.lines] == [
        "u2 = sign(u(t - tau))*max(abs(u(t - tau)) - d, 0)",
        "output = G[u2] - F*sign(rate(u2)) + c",
    ]
    assert any(note.startswith("G is the simulation linear:1: y(k) = a1 y(k-1)") for note in written.notes)


def test_terms_at_the_output_of_such_a_simulation_are_written_as_well() -> None:
    plain = make_simulator("linear:1", RECORD, {})
    wrapped = add_output_equation(plain, make_context(RECORD, plain, 200))
    assert texts(wrapped, "delay") == ["output = G[u(t - tau)]"]
    extended = replace(wrapped, system=wrapped.system.with_term("output", "u**3"))
    assert texts(extended, "delay", "offset") == [
        "y_sim = G[u(t - tau)]",
        "output = y_sim + u(t - tau)**3 + c",
    ]


def test_delays_and_clock_skews_shift_the_time_of_the_input() -> None:
    assert texts("linear:1", "delay", "clock-skew") == ["output = G[u(t*(1 + e) - tau)]"]


def test_a_free_curve_is_a_symbol_with_a_reference_to_its_figure() -> None:
    written = write("second-order", ["input-curve", "damping-curve"])
    assert "dv/dt = (u + f(u) - c*v - k*x - f2(v))/m" in [line.text for line in written.lines]
    assert written.values == ()
    assert sum("in the figure of the free forms" in note for note in written.notes) == 2


def test_an_effect_that_is_only_a_function_is_named() -> None:
    simulator = make_simulator("linear:1", RECORD, {})
    own = replace(CATALOGUE["offset"], name="own-map", summary="Map of a user", formula=None)
    extended = ExtendedSimulator(simulator, (own,), make_context(RECORD, simulator, 200))
    written = write_extended_equations(cast("CalibrationResult", Fit(extended)), (), RECORD)
    assert written.lines[-1].text == "output = f(G[u])"
    assert "f is the effect own-map: Map of a user" in written.notes


def test_calibrated_values_have_the_interval_of_the_finding() -> None:
    interval = Value(0.4, "V", (0.3, 0.5))
    finding = Finding("coulomb-friction", "memory", 0.9, (), {"F": interval}, 30.0, 0.9)
    written = write("second-order", ["coulomb-friction", "output-saturation"], [finding])
    assert [(each.name, each.effect) for each in written.values] == [
        ("F", "coulomb-friction"),
        ("L", "output-saturation"),
    ]
    assert written.values[0].estimate == interval
    assert written.values[1].estimate.unit == "m"
    assert "u is u_V, output is y_m" in written.notes
