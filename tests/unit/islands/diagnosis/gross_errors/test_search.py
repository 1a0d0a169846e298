"""Gross errors: each is named in an oscillator's record, and the corrected record has no discrepancy."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import DT, recorded, simulate_oscillator, wave

TOLERANCE = {"m": 0.02, "c": 0.05, "k": 0.02}
U = wave(400)
RNG = np.random.default_rng(5)
NOISE = 0.002 * RNG.standard_normal(U.size)
RECORD = replace(
    recorded(U, simulate_oscillator(U, 0.5, 4.0, 200.0) + NOISE, units=("N", "m")),
    u=np.column_stack([U, wave(700)[:-301:-1].repeat(2)[:400]]),
    input_names=("u_N", "w_V"),
    input_units=("N", "V"),
)


def run(record: Dataset, *, free: bool = False) -> Diagnosis:
    given = {} if free else {"m": 0.5, "c": 4.0, "k": 200.0}
    simulator = make_simulator(PhysicalSpec(kind="second-order", parameters=given), record)
    return diagnose(record, simulator, {} if free else TOLERANCE, catalogue=())


def scale_input(record: Dataset, factor: float) -> Dataset:
    return replace(record, u=record.u * [factor, 1.0])


def exchange_output(record: Dataset) -> Dataset:
    y, u = record.u[:, 0], np.column_stack([record.y, record.u[:, 1]])
    return replace(record, u=u, y=y)


def move(record: Dataset, samples: int) -> Dataset:
    """Return the record with an output that is recorded later."""
    kept = slice(max(samples, 0), U.size + min(samples, 0))
    return replace(record, y=np.roll(record.y, samples))[kept]


#: Injected error, names that this record cannot distinguish, value, and the correction that is advised.
ERRORS: dict[str, tuple[Callable[[Dataset], Dataset], set[str], object, Callable[[Dataset], Dataset]]] = {
    "milliseconds": (
        lambda record: replace(record, dt=record.dt / 1000),
        {"sampling-time"},
        ("factor", 1e-3),
        lambda record: replace(record, dt=DT),
    ),
    "twice the sampling time": (
        lambda record: replace(record, dt=2 * record.dt),
        {"sampling-time"},
        ("sampling time", DT),
        lambda record: replace(record, dt=DT),
    ),
    "output in mm": (
        lambda record: replace(record, y=1e3 * record.y),
        {"output-unit", "input-unit"},
        ("factor", 1e3),
        lambda record: replace(record, y=record.y / 1e3),
    ),
    "input in revolutions": (
        lambda record: scale_input(record, 0.5 / np.pi),
        {"output-unit", "input-unit"},
        ("factor", 2 * np.pi),
        lambda record: scale_input(record, 2 * np.pi),
    ),
    "inverted output": (
        lambda record: replace(record, y=-record.y),
        {"sign"},
        None,
        lambda record: replace(record, y=-record.y),
    ),
    "exchanged inputs": (
        lambda record: replace(record, u=record.u[:, ::-1]),
        {"swapped-channels"},
        None,
        lambda record: replace(record, u=record.u[:, ::-1]),
    ),
    "exchanged input and output": (exchange_output, {"swapped-channels"}, None, exchange_output),
    "early output": (
        lambda record: move(record, -7),
        {"time-offset"},
        ("samples", -7.0),
        lambda record: move(record, 7),
    ),
    "late output": (
        lambda record: move(record, 50),
        {"time-offset"},
        ("offset", 50 * DT),
        lambda record: move(record, -50),
    ),
}


#: Injected errors of every change, one of each name.
ESSENTIAL = ("milliseconds", "output in mm", "inverted output", "exchanged inputs", "late output")


@pytest.mark.ci
@pytest.mark.parametrize(
    "case", [case if case in ESSENTIAL else pytest.param(case, marks=pytest.mark.nightly) for case in ERRORS]
)
def test_gross_error_is_named_and_its_correction_leaves_no_discrepancy(case: str) -> None:
    spoil, names, value, correct = ERRORS[case]
    found = run(spoil(RECORD))
    assert found.verdict == Verdict.GROSS_ERROR
    (finding,) = found.effects
    assert {finding.name, *finding.equivalents} == names
    assert (finding.family, found.candidates, found.gain) == ("gross", (), None)
    if value is not None:
        assert finding.parameters[value[0]].value == pytest.approx(value[1])
    errors = found.record_findings[0].errors
    assert errors is not None
    assert errors[1] < 0.1 < errors[0]
    corrected = run(correct(spoil(RECORD)))
    assert (corrected.verdict, corrected.effects) == (Verdict.NOTHING, ())


def test_sampling_time_at_which_the_simulation_diverges_is_advised() -> None:
    document = {
        "name": "oscillator",
        "input": "F",
        "output": "x",
        "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x)/m\n",
        "parameters": {"m": {"value": 0.5}, "c": {"value": 4.0}, "k": {"value": 200.0}},
        "steps": 1,
    }
    simulator = make_simulator(OdeSpec.model_validate({"kind": "ode", **document}), RECORD)
    with pytest.raises(RecordError, match=r"diverges on this input.* Give 0.01 s as the sampling time"):
        diagnose(replace(RECORD, dt=1000 * DT), simulator, TOLERANCE, catalogue=())


@pytest.mark.ci
def test_free_parameters_absorb_a_unit_but_not_the_sign() -> None:
    assert run(replace(RECORD, y=1e3 * RECORD.y), free=True).verdict == Verdict.NOTHING
    flipped = run(replace(RECORD, y=-RECORD.y), free=True)
    assert flipped.effects[0].name == "sign"
    assert "m, c, k are all negative" in flipped.record_findings[0].description
    assert flipped.best.values[0] == pytest.approx(0.5, rel=0.05)
