"""Extended simulations as C: the program compiles without warnings and simulates like the package."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import islands
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Site
from islands.export.extension import export_extended
from islands.export.fmu import find_compiler
from islands.records.dataset import Dataset
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OUTPUT, OdeParameter
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from support.equation_programs import compare, extend, fix_states, list_effects, run_c
from support.simulated_records import EQUATIONS, made, recorded, wave

# Every program is compiled.
pytestmark = pytest.mark.ci

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")

BUILT_IN = ("second-order", "cascaded-tanks", "rigid-axis", "bouc-wen-piezo")

EXAMPLES = sorted(path.stem for path in EQUATIONS.glob("*.toml"))

#: Combinations of effects at all sites.
COMBINATIONS = {
    "second-order": (
        "dead-zone",
        "backlash",
        "coulomb-friction",
        "second-hysteresis",
        "sensor-lag",
        "offset",
    ),
    "cascaded-tanks": ("input-gain", "state-clip:upper", "outflow-law:lower", "gain-step", "sensor-gain"),
    "rigid-axis": ("input-saturation", "damping-curve", "input-offset:force", "linear-drift"),
    "bouc-wen-piezo": ("relaxation", "second-hysteresis", "viscous", "ageing", "exponential-creep"),
}

#: Terms as they are discovered, in equations and output: powers, saturations, Stribeck curves, growth.
TERMS = (
    ("v", "-a1*x**3", 40.0),
    ("v", "-a2*sign(v)*exp(-abs(v)/0.2)", 0.3),
    ("v", "a3*tanh(F/20)", 2.0),
    ("v", "a4*t*max(x, 0)", 1.0),
    (OUTPUT, "a5*x*abs(x)**1.5", 0.4),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("c")


@cache
def simulator_of(name):
    """Return a built-in simulator; the axis in free run, since a program has no measured output."""
    found = made()[name].simulator
    assert isinstance(found, OdeSimulator)
    return replace(found, shots=None)


@cache
def effects_of(name):
    return {each.name: each for each in list_effects(simulator_of(name), made()[name].record)}


@needs_compiler
@pytest.mark.parametrize("name", BUILT_IN)
def test_a_built_in_system_with_effects_is_simulated_like_the_package(name, folder):
    effects = [effects_of(name)[each] for each in COMBINATIONS[name]]
    spec, expected = extend(simulator_of(name), made()[name].record, effects)
    compare(run_c(spec, made()[name].record, folder), expected)


@needs_compiler
@pytest.mark.parametrize("name", BUILT_IN)
def test_every_effect_of_a_built_in_system_has_a_program(name, folder):
    """An effect without an equation or an expression fails here. Maps do not depend on the system."""
    record = made()[name].record
    for effect in effects_of(name).values():
        if name == "second-order" or effect.site in (Site.CORE, Site.FORCE):
            spec, expected = extend(simulator_of(name), record, [effect])
            compare(run_c(spec, record, folder), expected)


#: Systems and kinds of hold. At the level ci, each of both is in one combination at least.
HELD = [
    pytest.param(
        *(name, hold, times),
        marks=() if name == "second-order" or hold == "zero-order" else pytest.mark.nightly,
    )
    for name in BUILT_IN
    for hold, times in (("first-order", 3), ("zero-order", 2), ("band-limited", 3))
]


@needs_compiler
@pytest.mark.parametrize(("name", "hold", "times"), HELD)
def test_the_input_between_samples_is_that_of_the_simulation(name, hold, times, folder):
    """Effects in the equations and on the gain depend on it; a system can need several steps of each part."""
    simulator, record = simulator_of(name), made()[name].record
    simulator = replace(simulator, system=replace(simulator.system, steps=2))
    for effect in effects_of(name).values():
        is_inside = effect.site in (Site.CORE, Site.FORCE) and not effect.is_free
        if is_inside or effect.name in ("backlash", "dead-zone"):
            spec, expected = extend(simulator, record, [effect], hold, times)
            compare(run_c(spec, record, folder), expected)


def make_example(name):
    """Return an example with known states at the first sample, and a record for it."""
    document = OdeSpec.from_text("ode", str(EQUATIONS / f"{name}.toml")).model_dump(exclude_defaults=True)
    sizes = {"thermal-process": (40.0, 2.0), "cascaded-tanks": (3.0, 4.0), "hydraulic-actuator": (2.0, 2e-3)}
    size, dt = sizes.get(name, (12.0, 2e-3 if name == "dc-motor" else 0.01))
    u = size * (wave(300) / 50 + (0.9 if name in ("thermal-process", "cascaded-tanks") else 0.0))
    room = 20.0 + np.sin(0.01 * np.arange(u.size))
    columns = np.column_stack([u, room])
    record = Dataset(
        *(columns, 20.0 + 0.1 * u, dt),
        input_names=("drive_V", "room_degC"),
        input_units=("V", "degC"),
        output_name="y",
    )
    system = OdeSpec.model_validate(document).make_system()
    start = {each.name: each.initial or 0.3 * (each.lower == 0.0) for each in system.states}
    document = fix_states(document, start)
    return OdeSpec.model_validate({**document, "input_unit": "", "output_unit": ""}), record


@needs_compiler
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_simulated_like_the_package(name, folder):
    """All states at the first sample are known, so that the package fits none."""
    spec, record = make_example(name)
    simulator = make_simulator(spec, record)
    extended, _ = extend(simulator, record, [CATALOGUE["sensor-lag"], CATALOGUE["input-gain"]])
    document = json.loads(extended.model_dump_json())
    compare(run_c(extended, record, folder), np.asarray(islands.simulate(document, record).y))


@needs_compiler
@pytest.mark.parametrize("hold", ["first-order", "zero-order"])
def test_discovered_terms_are_in_the_program(hold, folder):
    spec, record = make_example("second-order")
    system = spec.make_system()
    for number, (target, term, value) in enumerate(TERMS, start=1):
        system = system.with_term(target, term, [OdeParameter(f"a{number}", value, "1/m^2/s^2")])
    simulator = make_simulator(OdeSpec.from_system(system), record)
    extended, expected = extend(simulator, record, (), hold, 1 if hold == "first-order" else 2)
    assert "double a1; /* 1/m^2/s^2 */" in export_extended(extended, "c")
    compare(run_c(extended, record, folder), expected)


@needs_compiler
def test_creep_of_a_resting_simulation_starts_before_the_record(folder):
    record = recorded(np.full(300, 3.0), np.full(300, 3.0))
    simulator = make_simulator(made()["bouc-wen-piezo"].spec, record)
    for name in ("exponential-creep", "logarithmic-creep"):
        extended, expected = extend(simulator, record, [CATALOGUE[name]])
        assert np.ptp(expected) > 0.01
        compare(run_c(extended, record, folder), expected)


@needs_compiler
def test_effects_of_channels_read_their_columns(folder):
    case = made()["bouc-wen-piezo"]
    samples = case.record.samples
    channels = [20.0 + np.sin(0.01 * np.arange(samples)), np.cos(0.02 * np.arange(samples))]
    record = Dataset(
        np.column_stack([case.record.u[:, 0], *channels]),
        *(case.record.y, case.record.dt),
        input_names=("u_V", "T_K", "w_V"),
        input_units=("V", "K", "V"),
        output_name="y_um",
        output_unit="um",
    )
    effects = [CATALOGUE["thermal-drift"], CATALOGUE["cross-coupling"]]
    extended, expected = extend(make_simulator(case.spec, record), record, effects)
    compare(run_c(extended, record, folder), expected)


@needs_compiler
@pytest.mark.parametrize(
    "names",
    [
        ("backlash", "dead-zone"),
        ("rate-limit", "input-saturation"),
        ("output-saturation", "linear-drift"),
        ("cyclic-error", "linear-drift"),
    ],
)
def test_maps_act_in_the_order_of_the_simulation(names, folder):
    known = [effects_of("second-order")[each] for each in names]
    record = made()["second-order"].record
    outputs = []
    for order in (known, known[::-1]):
        spec, expected = extend(simulator_of("second-order"), record, known, known=order)
        assert [each.name for each in spec.effects] == [each.name for each in order]
        compare(run_c(spec, record, folder), expected)
        outputs.append(expected)
    assert np.ptp(outputs[0] - outputs[1]) > 1e-3 * np.ptp(outputs[0])


@needs_compiler
@pytest.mark.parametrize("unit", ["*/ int broken = ;", "/* u", "\n#error", "\\\n", "µ°??/\n"])
def test_a_name_or_unit_cannot_break_the_file(unit, folder):
    spec, record = make_example("second-order")
    document = json.loads(spec.model_dump_json())
    document["name"] = f"{unit} {'long ' * 8}{unit}"
    document["parameters"]["m"]["unit"] = unit
    extended, expected = extend(make_simulator(OdeSpec.model_validate(document), record), record)
    compare(run_c(extended, record, folder), expected)
    assert export_extended(extended, "matlab").isascii()
