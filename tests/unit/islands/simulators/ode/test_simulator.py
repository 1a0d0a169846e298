"""Simulators that are equations: examples, several runs at once, mistakes in files."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import islands
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from islands.errors import ModelError, RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import BatchSimulator, SimulationRun, Simulator
from islands.simulators.intersample import ResampledSimulator
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import parse_spec
from support.repository import DOCS
from support.simulated_records import EQUATIONS, recorded, wave

Array = NDArray[np.float64]

#: Effects that are searched for: a force, and others that resemble it or a term of the output.
FEW = tuple(
    CATALOGUE[name]
    for name in ("coulomb-friction", "viscous", "backlash", "even-nonlinearity", "output-saturation")
)

EXAMPLES = sorted(path.stem for path in EQUATIONS.glob("*.toml"))

#: Sampling time of a record for an example, in seconds.
SAMPLING = {"thermal-process": 1.0, "cascaded-tanks": 4.0, "hydraulic-actuator": 2e-3, "dc-motor": 2e-3}

#: Size of the input for an example, 40 by default, and the units of input and output.
SIGNALS = {
    "cascaded-tanks": (3.0, "V", "V"),
    "thermal-process": (60.0, "W", "degC"),
    "hydraulic-actuator": (2.0, "V", "m"),
    "dc-motor": (12.0, "V", "rad/s"),
    "bouc-wen-piezo": (40.0, "V", "um"),
}


def make_record(name: str, samples: int = 400) -> Dataset:
    """Return a record for an example, with a room temperature; the output is not that of the example."""
    size, input_unit, output_unit = SIGNALS.get(name, (40.0, "N", "m"))
    dt = SAMPLING.get(name, 0.01)
    u = (
        size * (0.8 + wave(samples) / 50)
        if "tanks" in name or "thermal" in name
        else size * wave(samples) / 50
    )
    room = 20.0 + np.sin(0.01 * np.arange(samples))
    return Dataset(
        u=np.column_stack([u, room]),
        y=np.full(samples, 5.0) + 0.1 * np.arange(samples) / samples,
        dt=dt,
        input_names=("drive", "room_degC"),
        input_units=(input_unit, "degC"),
        output_name="y",
        output_unit=output_unit,
    )


def path_of(name: str) -> str:
    return f"ode:{EQUATIONS / name}.toml"


@cache
def example(name: str) -> ExtendedSimulator:
    record = make_record(name)
    return extend(make_simulator(path_of(name), record), record)


def extend(simulator: Simulator, record: Dataset) -> ExtendedSimulator:
    return ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))


@pytest.fixture(params=EXAMPLES)
def simulation(request: pytest.FixtureRequest) -> ExtendedSimulator:
    return example(request.param)


def test_every_parameter_of_an_example_has_a_unit_and_an_effect(simulation: ExtendedSimulator) -> None:
    before = simulation.simulate(simulation.nominal)
    assert np.isfinite(before).all()
    assert np.ptp(before) > 0.0
    for place, parameter in enumerate(simulation.parameters):
        values = simulation.nominal
        values[place] += simulation.scales[place]
        assert parameter.unit, parameter
        assert 1e-8 < np.max(np.abs(simulation.simulate(values) - before)) / np.ptp(before) < 10.0, parameter


def test_effects_enter_where_the_file_says() -> None:
    """A state that is the integral of another state has no balance; the shaft has its own unit of force."""
    motor = example("dc-motor")
    names = {each.name for each in motor.simulator.state_effects}
    assert names == {
        f"{effect}:{state}" for effect in ("input-offset", "state-clip") for state in ("i", "omega")
    }
    coordinate = motor.context.force_coordinate
    assert (coordinate.unit, coordinate.force_unit) == ("rad", "N m")
    assert 0.0 < coordinate.force < 0.05 * motor.context.input_peak


def test_a_recording_that_diverges_fails_its_point_only() -> None:
    record = islands.join((make_record("second-order"), make_record("second-order")))
    both = extend(make_simulator(path_of("second-order"), record), record)
    points = np.tile(both.nominal, (2, 1))
    points[1, [each.name for each in both.parameters].index("initial x (recording 2)")] = 1e9
    found = both.simulate_batch(points)
    assert np.isnan(found).all(axis=1).tolist() == [False, True]
    assert np.array_equal(found[0], both.simulate(points[0]))


def test_runs_at_once_have_the_bits_of_single_runs() -> None:
    simulation = example("dc-motor")
    simulator, context = simulation.simulator, simulation.context
    assert isinstance(simulator, BatchSimulator)
    law = CATALOGUE["coulomb-friction"]
    values = np.array([each.nominal for each in simulator.parameters])
    runs = [
        SimulationRun(
            values * (1 + 0.01 * i),
            context.u if i < 6 else 1.1 * context.u,
            {"ageing": 0.01 * i, "input-offset:omega": 0.5 * i, "state-clip:i": 10.0 - i},
            ((law.form, np.array([1e-3 * i, 0.5])),),
        )
        for i in range(10)
    ]
    together = simulator.simulate_batch(runs, context)
    for run, output in zip(runs, together, strict=True):
        alone = simulator.simulate(run.values, run.x, context, run.effect_parameters, run.forces)
        assert np.array_equal(alone, output)
    assert len({each.tobytes() for each in together}) == len(runs)


def test_tolerances_are_those_of_the_file() -> None:
    simulator = example("dc-motor").simulator
    expected = {"R": 0.05, "L": 0.1, "K": 0.03, "J": 0.05}
    assert ResampledSimulator(simulator).tolerances == expected
    assert example("bouc-wen-piezo").simulator.tolerances == {}
    with pytest.raises(SettingsError, match="tolerance"):  # given ones take precedence
        islands.diagnose(make_record("dc-motor"), simulator, tolerance={"R": 2.0})


def test_the_example_of_the_guide_is_the_motor() -> None:
    guide = (DOCS / "how-to" / "write-a-simulation.md").read_text("utf-8")
    _, _, motor = (EQUATIONS / "dc-motor.toml").read_text("utf-8").partition("\n")
    assert f"```toml\n{motor}```" in guide


def test_a_record_without_the_channel_or_with_other_units_is_refused() -> None:
    with pytest.raises(RecordError, match=r"the equations read the channel room, and .* are none"):
        make_simulator(path_of("thermal-process"), make_record("thermal-process").first_inputs(1))
    with pytest.raises(
        RecordError, match="the output of thermal-process is in degC, that of the record in m"
    ):
        make_simulator(
            path_of("thermal-process"), Dataset(**{**fields("thermal-process"), "output_unit": "m"})
        )


def fields(name: str) -> dict[str, object]:
    record = make_record(name)
    return {
        each: getattr(record, each) for each in ("u", "y", "dt", "input_names", "input_units", "output_name")
    }


#: A sensor without dynamics.
STATIC = """
name = "sensor"
input = "u"
output = "k*u"
equations = ""
[parameters]
k = { value = 2.0, unit = "um/V" }
"""


def make_static(tmp_path: Path) -> tuple[str, Dataset]:
    """Return a static gain, and a record of a sensor with another gain and a cubic term."""
    (tmp_path / "sensor.toml").write_text(STATIC)
    u = wave(400)
    noise = 0.05 * np.random.default_rng(0).normal(size=u.size)
    return f"ode:{tmp_path}/sensor.toml", recorded(u, 2.2 * u + 1e-3 * u**3 + noise)


@pytest.mark.nightly
def test_a_missing_term_of_equations_without_states_is_discovered(tmp_path: Path) -> None:
    path, record = make_static(tmp_path)
    diagnosis = islands.diagnose(record, path, effects=FEW)
    assert diagnosis.verdict == Verdict.DISCOVERED
    assert diagnosis.discovery.equations.startswith("output = k*u + a1*u**3")
    assert diagnosis.effects[0].parameters["a1"].value == pytest.approx(1e-3, rel=0.01)


def test_a_diverging_simulation_is_refused(tmp_path: Path) -> None:
    text = (EQUATIONS / "second-order.toml").read_text().replace("- k*x", "+ 1e6*k*x")
    (tmp_path / "unstable.toml").write_text(text)
    with pytest.raises(RecordError, match="the simulation second-order diverges on this input"):
        make_simulator(f"ode:{tmp_path}/unstable.toml", make_record("second-order"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value = 0.5", 'value = "big"', "parameters.m.value: Input should be a valid number"),
        ("value = 0.5", "vaule = 0.5", "parameters.m.vaule: Extra inputs .* Did you mean 'value'"),
        (
            "c*v",
            "cc*v",
            "second.toml: line 2 of the equations, .*unknown name 'cc': known are .* Did you mean 'c'",
        ),
        ('input = "F"', "", "input: Field required"),
        ("[states]", "[state]", "state: Extra inputs are not permitted"),
        ("[parameters]", "[parameters", "cannot be read as TOML"),
    ],
)
def test_a_mistake_in_a_file_is_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "second.toml").write_text((EQUATIONS / "second-order.toml").read_text().replace(old, new, 1))
    with pytest.raises((SettingsError, ModelError), match=message):
        parse_spec(f"ode:{tmp_path}/second.toml")


def simulate_motor(samples: int, friction: float) -> tuple[Array, Array]:
    """Return voltage and speed of a DC motor with dry friction, by the Euler method with small steps."""
    u, steps, dt = 12.0 * wave(samples) / 50, 20, 2e-3
    fine = np.interp(np.arange(samples * steps) / steps, np.arange(samples), u)
    i, omega, speeds = 0.0, 0.0, np.empty(samples)
    for k, voltage in enumerate(fine.tolist()):
        if k % steps == 0:
            speeds[k // steps] = omega
        slope = (voltage - 1.22 * i - 0.0495 * omega) / 0.004
        omega += dt / steps * (0.0495 * i - 2e-5 * omega - friction * np.tanh(omega / 0.3)) / 1.5e-4
        i += dt / steps * slope
    return u, speeds


@pytest.mark.nightly
def test_dry_friction_that_the_equations_lack_is_named() -> None:
    """The parameters differ from those of the file by less than their tolerances, which therefore apply."""
    u, speed = simulate_motor(600, 4e-3)
    noisy = speed + 0.3 * np.random.default_rng(1).standard_normal(speed.size)
    record = Dataset(
        **{**fields("dc-motor"), "u": u[:, None], "y": noisy, "input_names": ("u_V",), "input_units": ("V",)}
    )
    found = islands.diagnose(record, path_of("dc-motor"), effects=FEW)
    assert found.verdict == Verdict.NAMED
    friction, *others = found.effects
    assert (friction.name, others) == ("coulomb-friction", [])
    strength = friction.parameters["F"]
    assert strength.unit == "N m"
    assert strength.value == pytest.approx(4e-3, rel=0.1)
    assert "wrong-parameter" in {each.name for each in found.candidates}
