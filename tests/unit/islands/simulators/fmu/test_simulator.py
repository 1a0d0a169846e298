"""Simulators that are FMUs: agreement with equations and models, records that do not fit, hidden effects."""

import json
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import islands
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from islands.errors import RecordError
from islands.export import write_export
from islands.export.fmu import find_compiler
from islands.models.narx import Model
from islands.persistence.models import model_from_json
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.factory import make_simulator
from support.oscillator_fmus import write_oscillator
from support.simulated_records import DT, EQUATIONS, FMUS, MODEL, recorded, simulate_oscillator, wave

# The library of FMUs is imported and compiled for, which takes seconds.
pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc"),
]

Array = NDArray[np.float64]

INTERFACES = ("model-exchange", "co-simulation")


@cache
def oscillator(**options: object) -> str:
    name = "-".join(f"{key}{value}" for key, value in options.items())
    return str(write_oscillator(Path(FMUS.name) / f"mass{name}.fmu", **options))  # type: ignore[arg-type]


def oscillation(samples: int = 600, noise: float = 0.0, start: float = 0.0) -> Dataset:
    u = wave(samples)
    y = simulate_oscillator(u, 0.5, 4.0, 200.0)
    # The free decay of a mass that is released at `start`.
    rate, frequency = 4.0, np.sqrt(400.0 - 16.0)
    t = DT * np.arange(samples)
    y += start * np.exp(-rate * t) * (np.cos(frequency * t) + rate / frequency * np.sin(frequency * t))
    return recorded(u, y + noise * np.random.default_rng(3).standard_normal(samples), units=("N", "m"))


def simulate(simulator: Simulator, record: Dataset, **values: float) -> Array:
    context = make_context(record, simulator, record.samples)
    alone = ExtendedSimulator(simulator, (), context)
    given = alone.nominal
    for place, parameter in enumerate(alone.parameters):
        given[place] = values.get(parameter.name, given[place])
    return alone.simulate(given)


@pytest.mark.parametrize("version", [2, 3])
def test_a_model_exchange_agrees_with_the_equations(version: int) -> None:
    record = oscillation(start=0.1)
    fmu = make_simulator(f"fmu:{oscillator(version=version)}", record)
    ode = make_simulator(f"ode:{EQUATIONS / 'second-order.toml'}", record)
    known = {"m": 0.5, "c": 4.0, "k": 200.0, "initial x": 0.1, "initial v": 0.2}
    assert {each.name for each in fmu.parameters} == known.keys()
    found = simulate(fmu, record, **known)
    np.testing.assert_allclose(found, simulate(ode, record, **known), rtol=0, atol=1e-12)


@pytest.mark.parametrize("interface", INTERFACES)
def test_initial_states_are_fitted_to_a_record(interface: str) -> None:
    record = oscillation(start=0.1)
    found = simulate_spec(FmuSpec(kind="fmu", file=oscillator(), interface=interface), record)  # type: ignore[arg-type]
    assert np.abs(found - record.y).max() < 2e-3 * np.abs(record.y).max()


@pytest.mark.parametrize("kind", ["fmu", "fmu2"])
@pytest.mark.parametrize("dt", [DT, 4 * DT])
def test_an_exported_model_gives_its_free_run(kind: str, dt: float, tmp_path: Path) -> None:
    """With the past samples before the record as initial values; a longer step repeats the input."""
    model: Model = replace(model_from_json(json.dumps(MODEL), "m"), dt=DT)
    write_export(model, kind, tmp_path / "model.fmu")
    record = recorded(wave(300, dt), np.zeros(300), dt)
    simulator = make_simulator(f"fmu:{tmp_path / 'model.fmu'}", record)
    assert [each.name for each in simulator.parameters] == [
        "initial start.y_um[1]",
        "initial start.u_V[1]",
        "initial start.u_V[2]",
    ]
    u = [7.0, 3.0, *np.repeat(record.u[:, 0], round(dt / DT))]
    y = [2.0]
    for k in range(2, len(u)):
        y.append(0.8 * y[-1] + 0.15 * u[k - 1] + 0.002 * u[k - 2] ** 2)
    past = dict(zip([each.name for each in simulator.parameters], (2.0, 3.0, 7.0), strict=True))
    found = simulate(simulator, record, **past)
    np.testing.assert_allclose(found, y[1 :: round(dt / DT)], rtol=1e-12)


def test_a_simulator_is_sent_to_another_process_by_its_path() -> None:
    record = oscillation()
    simulator = make_simulator(f"fmu:{oscillator()}", record)
    content = pickle.dumps(simulator)
    assert len(content) < 10_000
    assert np.array_equal(simulate(pickle.loads(content), record), simulate(simulator, record))


@pytest.mark.parametrize(
    ("change", "query", "message"),
    [
        ({"dt": 0.004}, "", "fixed step of 0.005 s, of which the sampling time 0.004 s is not a multiple"),
        (
            {"input_names": ("u_kN",), "input_units": ("kN",)},
            "",
            "the input u of .* is in N, that of the record in kN: convert the column",
        ),
        (
            {"output_name": "y_V", "output_unit": "V"},
            "",
            "the output x of .* is in m, that of the record in V: convert the column",
        ),
        (
            {},
            "?parameters=m=-1",
            r"\(fmi3EnterInitializationMode failed .*: m is out of range\): check its par",
        ),
    ],
)
def test_a_record_that_does_not_fit_is_refused(change: dict[str, object], query: str, message: str) -> None:
    path = oscillator(interfaces="CoSimulation", fixed_step=0.005)
    with pytest.raises(RecordError, match=message):
        make_simulator(f"fmu:{path}{query}", replace(oscillation(), **change))  # type: ignore[arg-type]


@pytest.mark.nightly
def test_a_hidden_effect_is_named_and_a_clean_record_has_none(tmp_path: Path) -> None:
    """The output of the FMU is cut off at 0.15 m; the result is saved, and simulated and diagnosed again."""
    clean = oscillation(250, 0.001)
    path = tmp_path / "axis.toml"
    tolerances = "\n".join(f"{name} = {{ tolerance = 0.05 }}" for name in ("m", "c", "k"))
    path.write_text(f'file = "{oscillator()}"\n[parameters]\n{tolerances}\n')
    simulator = make_simulator(f"fmu:{path}", clean)
    assert simulator.tolerances == {"m": 0.05, "c": 0.05, "k": 0.05}
    names = ("output-saturation", "offset", "delay", "even-nonlinearity", "coulomb-friction", "viscous")
    effects = [CATALOGUE[name] for name in names]
    assert islands.diagnose(clean, simulator, effects=effects).verdict == Verdict.NOTHING
    limited = replace(clean, y=np.clip(oscillation(250).y, -0.15, 0.15) + clean.y - oscillation(250).y)
    found = islands.diagnose(limited, f"fmu:{path}", effects=effects)
    assert found.verdict == Verdict.NAMED
    assert [each.name for each in found.effects] == ["output-saturation"]
    document = extended_document(found.best, limited)
    assert document["core"]["parameters"]["m"]["tolerance"] == 0.05
    again = islands.simulate(document, limited)
    np.testing.assert_allclose(again.y, found.best.output, rtol=0, atol=2e-4)
