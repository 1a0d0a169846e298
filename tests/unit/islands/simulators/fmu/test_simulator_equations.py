"""Equations around FMUs: terms and effects act as in written equations, and missing terms are discovered."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import islands
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Parameter, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.effects.interface.force import ForceLaw
from islands.errors import ModelError
from islands.export.closed_form import closed_form
from islands.export.fmu import find_compiler
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from support.oscillator_fmus import write_oscillator
from support.simulated_records import FMUS, recorded, wave

# The library of FMUs is imported and compiled for, which takes seconds.
pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc"),
]

Array = NDArray[np.float64]

#: Equations of the FMU.
PLAIN = {"v": "(u - c*v - k*x)/m", "output": "x"}

#: Parameters of the FMU, and a coefficient of the terms.
PARAMETERS = {"m": 0.5, "c": 4.0, "k": 200.0}

#: Terms of states, the input, its rate and time.
TERMS = {
    "v": "- d*x**3 - 1e-4*d*rate(u)*v - 2*t",
    "output": "+ 0.001*d*u*x",
}

FORCE = {"coordinate": "x", "rate": "v"}


def maxwell_force(_x: float, _v: float, z: float, numbers: Array) -> float:
    return numbers[0] * z


def maxwell_derivative(_x: float, v: float, z: float, numbers: Array) -> float:
    return v - z / numbers[1]


def two_parameters(_context: SimulationContext) -> tuple[Parameter, ...]:
    return Parameter("k", "N/m", 0.0, 1.0), Parameter("tau", "s", 0.1, 0.01)


#: A force of a user, which is a function and no expression.
MAXWELL = Effect(
    name="maxwell",
    summary="A spring in series with a damper",
    family="memory",
    site=Site.FORCE,
    parameters=two_parameters,
    starting_points=lambda _context, _residual: ((1.0, 0.1),),
    form=ForceLaw(maxwell_force, maxwell_derivative),
    source="test",
)


@cache
def oscillator(**options: object) -> str:
    name = "-".join(f"{key}{value}" for key, value in options.items())
    return str(write_oscillator(Path(FMUS.name) / f"equations{name}.fmu", **options))  # type: ignore[arg-type]


def make_fmu(terms: dict[str, str], force: bool = False, **fields: object) -> FmuSpec:
    """Return the FMU with more terms in the equation of v and of the output."""
    equations = "".join(
        f"{'output = x' if name == 'output' else f'd{name}/dt = fmu({name})'} {term}\n"
        for name, term in terms.items()
    )
    coefficients = {"d": 30.0} if any("d*" in term for term in terms.values()) else {}
    document = {
        "kind": "fmu",
        "file": oscillator(),
        "equations": equations,
        "coefficients": coefficients,
        "force": FORCE if force else None,
    }
    return FmuSpec.model_validate({**document, **fields})


def make_equations(terms: dict[str, str], force: bool = False) -> OdeSpec:
    """Return the same simulation as equations."""
    right = {name: f"{plain} {terms.get(name, '')}" for name, plain in PLAIN.items()}
    more = {"d": 30.0} if any("d*" in term for term in terms.values()) else {}
    document = {
        "kind": "ode",
        "name": "oscillator",
        "input": "u",
        "equations": f"dx/dt = v\ndv/dt = {right['v']}\n",
        "output": right["output"],
        "parameters": {name: {"value": value} for name, value in {**PARAMETERS, **more}.items()},
        "states": {"x": {"unit": "m"}, "v": {"unit": "m/s"}},
        "force": FORCE if force else {"coordinate": "u"},
    }
    return OdeSpec.model_validate(document)


def simulate(
    spec: FmuSpec | OdeSpec, names: tuple[str, ...] = (), values: tuple[float, ...] = (), samples: int = 300
) -> Array:
    """Simulate from the same initial values, with effects and their values."""
    u = wave(samples)
    record = recorded(u, 0.1 * np.ones(samples), units=("N", "m"))
    simulator = make_simulator(spec, record)
    context = make_context(record, simulator, samples)
    known: dict[str, Effect] = {
        "maxwell": MAXWELL,
        **CATALOGUE,
        **{each.name: each for each in simulator.state_effects},
    }
    extended = ExtendedSimulator(simulator, tuple(known[name] for name in names), context)
    given = {"initial x": 0.1, "initial v": -0.2, **PARAMETERS, "d": 30.0}
    inner = [given[each.name] for each in simulator.parameters]
    return extended.simulate(np.array([*inner, *values]))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb-friction", (3.0,)),
        ("input-offset:v", (5.0,)),
        ("state-clip:v", (0.8,)),
        ("second-hysteresis", (60.0, 5.0, 2.0, 0.02)),
        pytest.param("maxwell", (60.0, 0.1), marks=pytest.mark.ci),
    ],
)
def test_effects_act_in_the_derivative_of_a_state_as_in_written_equations(
    name: str, values: tuple[float, ...]
) -> None:
    resisted = {"v": "- force/m"}
    found = simulate(make_fmu(resisted, force=True), (name,), values)
    expected = simulate(make_equations(resisted, force=True), (name,), values)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
    assert np.abs(found - simulate(make_fmu(resisted, force=True))).max() > 0.005


def make_record(spec: FmuSpec | OdeSpec, samples: int = 300, noise: float = 1e-3) -> Dataset:
    """Return what a simulation gives for the input, with noise."""
    y = simulate(spec, samples=samples)
    y += noise * np.random.default_rng(3).standard_normal(samples)
    return recorded(wave(samples), y, units=("N", "m"))


@pytest.mark.nightly
def test_a_missing_stiffness_is_discovered_in_the_equation_of_an_fmu() -> None:
    """The equations of the record have a cubic term; the extended FMU is saved and simulated again."""
    record = make_record(make_equations({"v": "- 60*d*x**3"}))
    spec = FmuSpec(kind="fmu", file=oscillator())
    found = islands.diagnose(record, spec, effects=[CATALOGUE["dead-zone"]])
    assert found.verdict == Verdict.DISCOVERED
    assert found.discovery is not None
    assert found.discovery.equations.startswith("dv/dt = fmu(v) + a1*x**3; a1 = ")
    assert found.effects[0].parameters["a1"].value == pytest.approx(-1800.0, rel=0.05)
    assert found.gain is not None
    assert found.gain.ci95[0] > 50.0
    document = extended_document(found.best, record)
    assert document["core"]["equations"] == "dv/dt = fmu(v) + a1*x**3\n"
    again = simulate_spec(document, record)
    np.testing.assert_allclose(again, found.best.output, rtol=0, atol=5e-4)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"equations": "dw/dt = u"},
            "the FMU has no state w whose initial value is estimated: take one of x, v",
        ),
        ({"equations": "dv/dt = fmu(w)"}, "an FMU does not compute w: take one of x, v"),
        ({"equations": "dv/dt = fmu(v) - d*x"}, "unknown name 'd'"),
        ({"equations": "dv/dt = u\ndv/dt = x"}, "'v' is defined twice"),
        ({"coefficients": {"d": 1.0}}, "reads the coefficient d: remove it"),
        ({"equations": "dv/dt = fmu(v) - force/m"}, "force needs a table"),
        ({"force": {"coordinate": "x", "rate": "v"}}, "reads force: subtract it"),
        (
            {"force": {"coordinate": "y", "rate": "v"}, "equations": "dv/dt = fmu(v) - force/m"},
            "unknown name 'y'",
        ),
        (
            {"interface": "co-simulation", "equations": "dx/dt = u"},
            "take one of none, since it is a co-simulation",
        ),
        (
            {"initial": ["v"], "equations": "dv/dt = fmu(x)"},
            r"fmu\(x\) is possible in the equation of output only",
        ),
    ],
)
def test_equations_that_do_not_fit_the_fmu_are_refused(fields: dict[str, object], message: str) -> None:
    spec = FmuSpec.model_validate({"kind": "fmu", "file": oscillator(), **fields})
    with pytest.raises(ModelError, match=message):
        spec.make_system(spec.make_model())


def test_a_fmu_in_written_equations_is_refused() -> None:
    with pytest.raises(ValueError, match="an FMU does not compute v: take one of none here"):
        make_equations({"v": "+ fmu(v)"})


def test_formats_of_difference_equations_refuse_an_extended_fmu() -> None:
    with pytest.raises(ModelError, match="the simulation fmu has no closed form"):
        closed_form(make_fmu(TERMS))
