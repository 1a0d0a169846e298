"""Extended simulations as MATLAB: Octave runs the program, and it simulates like the package."""

from dataclasses import replace

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Site
from islands.export.extension import export_extended
from islands.records.dataset import Dataset
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from support.equation_programs import OCTAVE, compare, extend, list_effects, run_matlab
from support.simulated_records import EQUATIONS, made, recorded, wave

needs_octave = pytest.mark.skipif(OCTAVE is None, reason="no octave-cli: install Octave to run the MATLAB")

BUILT_IN = ("second-order", "cascaded-tanks", "rigid-axis", "bouc-wen-piezo")

#: Samples of a record: Octave interprets each step.
SAMPLES = 120


def make_case(name):
    """Return a built-in system in free run, and a short record."""
    case = made()[name]
    record = case.record[:SAMPLES]
    simulator = make_simulator(case.spec, record)
    assert isinstance(simulator, OdeSimulator)
    return replace(simulator, shots=None), record


@needs_octave
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.ci if name == "second-order" else pytest.mark.nightly)
        for name in BUILT_IN
    ],
)
def test_every_effect_of_a_built_in_system_is_simulated_like_the_package(name, tmp_path):
    simulator, record = make_case(name)
    programs, outputs = [], []
    for effect in list_effects(simulator, record):
        # Maps do not depend on the system.
        if name == "second-order" or effect.site in (Site.CORE, Site.FORCE):
            spec, expected = extend(simulator, record, [effect])
            programs.append((spec, record))
            outputs.append(expected)
    for found, expected in zip(run_matlab(programs, tmp_path), outputs, strict=True):
        compare(found, expected)


@pytest.mark.ci
@needs_octave
@pytest.mark.parametrize(("hold", "times"), [("first-order", 3), ("zero-order", 2), ("band-limited", 2)])
def test_the_input_between_samples_is_that_of_the_simulation(hold, times, tmp_path):
    programs, outputs = [], []
    for name, effects in (
        ("second-order", ("gain-step", "coulomb-friction")),
        ("bouc-wen-piezo", ("ageing", "second-hysteresis")),
    ):
        simulator, record = make_case(name)
        simulator = replace(simulator, system=replace(simulator.system, steps=2))
        spec, expected = extend(simulator, record, [CATALOGUE[each] for each in effects], hold, times)
        programs.append((spec, record))
        outputs.append(expected)
    for found, expected in zip(run_matlab(programs, tmp_path), outputs, strict=True):
        compare(found, expected)


@pytest.mark.ci
@needs_octave
def test_equations_with_a_channel_a_delay_and_real_functions_are_simulated(tmp_path):
    """Where a root or a power is complex in MATLAB, it is not a number in the package, and not here."""
    record = Dataset(
        np.column_stack([60.0 * (1.0 + wave(SAMPLES) / 60.0), 20.0 + np.sin(0.05 * np.arange(SAMPLES))]),
        *(20.0 + np.arange(SAMPLES) / SAMPLES, 1.0),
        input_names=("P_W", "room_degC"),
        input_units=("W", "degC"),
        output_name="T_degC",
        output_unit="degC",
    )
    thermal = make_simulator(OdeSpec.from_text("ode", str(EQUATIONS / "thermal-process.toml")), record)
    document = {
        "kind": "ode",
        "name": "functions",
        "input": "u",
        "equations": "dx/dt = where(u > 1, 1, -1) - sign(x)*abs(x)**0.5 - log(2 + x*x)*x + (x < 0.1)",
        "output": "sqrt(max(x, 0)) + min(x, 0.2, u)**3",
        "states": {"x": {"initial": 0.1, "fixed": True}},
    }
    plain = recorded(wave(SAMPLES), wave(SAMPLES))
    functions = make_simulator(OdeSpec.model_validate(document), plain)
    cases = [
        (extend(thermal, record, [CATALOGUE["thermal-drift"]]), record),
        (extend(thermal, record, [], "zero-order", 2), record),
        (extend(functions, plain, []), plain),
    ]
    found = run_matlab([(spec, given) for (spec, _), given in cases], tmp_path)
    for output, ((_, expected), _) in zip(found, cases, strict=True):
        compare(output, expected)


def test_the_program_describes_itself():
    simulator, record = make_case("second-order")
    spec, _ = extend(simulator, record, [CATALOGUE["coulomb-friction"]])
    text = export_extended(spec, "matlab")
    assert text.isascii()
    assert text.startswith("function y = extended_simulation(u, initial, p)\n")
    assert "% Effect coulomb-friction: Dry friction: - F sign(x')." in text
    assert "p.coulomb_friction_F = " in text
    assert "; % N s^2/m" in text
    assert max(map(len, text.splitlines())) <= 120
