"""Diagnosis of unusable records and simulations: a one-line error, or a verdict."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from islands.errors import IslandsError, RecordError
from islands.records.dataset import Dataset
from islands.simulators.specification.table import LocalSpec, PhysicalSpec
from support.simulated_records import MODEL_SPEC, PROGRAM_SPEC, recorded, wave

#: Simulations whose parameters come from the record, and simulations that are given completely.
SIMULATIONS: dict[str, str | LocalSpec] = {
    **{name: name for name in ("bouc-wen-piezo", "second-order", "rigid-axis", "cascaded-tanks", "linear:1")},
    "column": "column:theirs",
    "python": PROGRAM_SPEC,
    "model": MODEL_SPEC,
}


@pytest.fixture(scope="module")
def record() -> Dataset:
    u = wave()
    return recorded(u, 0.8 * u + 0.05 * np.random.default_rng(0).standard_normal(u.size))


def with_y(record: Dataset, change: Callable[[np.ndarray], object]) -> Dataset:
    y = np.array(record.y)
    change(y)
    return replace(record, y=y)


SPOILT: dict[str, Callable[[Dataset], Dataset]] = {
    "one sample": lambda record: record[:1],
    "two samples": lambda record: record[:2],
    "five samples": lambda record: record[:5],
    "fifty samples": lambda record: record[:50],
    "one sample too few": lambda record: record[:199],
    "a constant output": lambda record: with_y(record, lambda y: y.fill(2.0)),
    "a zero output": lambda record: with_y(record, lambda y: y.fill(0.0)),
    "few outputs": lambda record: with_y(record, lambda y: y.__setitem__(slice(50, 460), np.nan)),
    "no output at the end": lambda record: with_y(record, lambda y: y.__setitem__(slice(460, 600), np.nan)),
    "no output": lambda record: with_y(record, lambda y: y.fill(np.nan)),
}


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "case"),
    [
        # For every change: each case with one simulation, and each simulation with one case.
        pytest.param(
            name, case, marks=() if (first - second) % len(SIMULATIONS) == 0 else pytest.mark.nightly
        )
        for first, name in enumerate(SIMULATIONS)
        for second, case in enumerate(SPOILT)
    ],
)
def test_uninformative_record_is_rejected_for_every_simulation(record: Dataset, name: str, case: str) -> None:
    spoilt = SPOILT[case](record)
    theirs = 0.8 * record.u[: spoilt.samples, 0]
    with pytest.raises(RecordError) as raised:
        islands.diagnose(spoilt, SIMULATIONS[name], columns={"theirs": theirs})
    assert len(str(raised.value)) > 20


COLUMNS = {
    "shorter": (lambda theirs: theirs[:100], r"column theirs has the shape \(100,\), the measured output"),
    "two of them": (lambda theirs: np.stack([theirs, theirs], axis=1), r"has the shape \(600, 2\)"),
    "a gap": (lambda theirs: np.where(np.arange(600) == 50, np.nan, theirs), "column theirs has gaps"),
    "a gap in the hold-out part": (
        lambda theirs: np.where(np.arange(600) == 590, np.nan, theirs),
        "has gaps",
    ),
}


@pytest.mark.parametrize("case", COLUMNS)
def test_column_with_other_samples_is_rejected(record: Dataset, case: str) -> None:
    change, message = COLUMNS[case]
    with pytest.raises(RecordError, match=message):
        islands.diagnose(record, "column:theirs", columns={"theirs": change(0.8 * record.u[:, 0])})


FUNCTIONS = {
    "raises": ("def f(u, dt, k=1.0):\n    raise ValueError('no')", "f fails: ValueError: no"),
    "exits": ("def f(u, dt):\n    raise SystemExit(3)", "f fails: SystemExit: 3"),
    "another length": (
        "def f(u, dt):\n    return u[:3]",
        r"an output of shape \(3,\) for an input of \(600,\)",
    ),
    "a number": ("def f(u, dt):\n    return 1.0", r"of shape \(\)"),
    "a matrix": ("def f(u, dt):\n    return u[:, None]", r"of shape \(600, 1\)"),
    "nothing": ("def f(u, dt):\n    pass", r"of shape \(\)"),
    "strings": ("def f(u, dt):\n    return ['a'] * len(u)", "could not convert"),
    "no finite values": ("def f(u, dt):\n    return u * float('nan')", "diverges on this input"),
    "a parameter without a number": ("def f(u, dt, k):\n    return u", "k needs a number for its default"),
    "a parameter with a string": ("def f(u, dt, k='a'):\n    return u", "k needs a number"),
    "an infinite parameter": ("def f(u, dt, k=float('inf')):\n    return u", "k needs a number"),
    "any parameters": ("def f(u, dt, **more):\n    return u", "more needs a number"),
    "one argument": ("def f(u):\n    return u", r"must take \(u, dt\)"),
    "unknown signature": ("f = max", "the arguments of .* are unknown"),
    "no function": ("g = 1", "has no function 'f'"),
    "no callable": ("f = 1", "has no function 'f'"),
    "no Python": ("def f(", "cannot be run: SyntaxError"),
    "exits on import": ("raise SystemExit(3)", "cannot be run: SystemExit"),
}


@pytest.mark.parametrize("case", FUNCTIONS)
def test_function_that_does_not_simulate_is_rejected(record: Dataset, tmp_path: Path, case: str) -> None:
    text, message = FUNCTIONS[case]
    path = tmp_path / "theirs.py"
    path.write_text(text)
    with pytest.raises(IslandsError, match=message):
        islands.diagnose(record, f"python:{path}:f")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("linear:11", "linear:11: order: Input should be less than or equal to 10"),
        ("linear:x", "linear:x: order: "),
        ("linear:1.5", "order: "),
        ("linear:", "order: "),
        ("linear:2:-1", "linear:2:-1: delay: Input should be greater than or equal to 0"),
        ("linear:2:1001", "delay: "),
        ("linear:2:x", "delay: "),
        ("linear:2:1:3", "delay: "),
        ("linear:2:999", "too few to estimate a linear model of order 2"),
        ("column:", "column: "),
        ("column:none", "unknown column 'none'"),
        ("second-order:none.json", "none.json cannot be read as JSON"),
        ("pendulum", "unknown simulation 'pendulum': take one of bouc-wen-piezo"),
        ("", "unknown simulation ''"),
    ],
)
def test_unknown_simulation_is_rejected(record: Dataset, text: str, message: str) -> None:
    with pytest.raises(IslandsError, match=message):
        islands.diagnose(record, text)


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("second-order", {"mass": 1.0}, "there is no parameter mass: the parameters are m, c, k"),
        ("second-order", {"m": 0.0}, "a mass of zero"),
        ("second-order", {"m": 1e-300}, "diverges on this input"),
        ("rigid-axis", {"k": 1.0}, "there is no parameter k: the parameters are m, c, F, vs"),
        ("rigid-axis", {"m": 0.0}, "m = 0 is not possible for rigid-axis: give a positive value"),
        ("rigid-axis", {"F": -1.0}, "F = -1 is not possible for"),
        ("cascaded-tanks", {"k2": 0.0}, "k2 = 0 is not possible for"),
        ("cascaded-tanks", {"k4": 1.0}, "there is no parameter k4"),
        ("bouc-wen-piezo", {"gamma": -5.0}, "diverges on this input: check its parameters"),
    ],
)
def test_impossible_parameters_are_rejected(
    record: Dataset, kind: str, parameters: dict[str, float], message: str
) -> None:
    with pytest.raises(IslandsError, match=message), np.errstate(all="ignore"):
        islands.diagnose(record, PhysicalSpec(kind=kind, parameters=parameters))


def test_rigid_axis_states_the_required_record_length(record: Dataset) -> None:
    with pytest.raises(RecordError, match="shooting needs 80 samples, the record has 50"):
        islands.diagnose(record[:50], "rigid-axis")


#: Effects that are searched for at the level ci; at the nightly level it is the whole catalogue.
FEW = ("delay", "offset", "cubic-stiffness")


@pytest.mark.nightly
@pytest.mark.parametrize(
    "effects",
    [FEW, tuple(CATALOGUE)],
    ids=len,
)
def test_tanks_with_negative_levels_have_a_verdict(record: Dataset, effects: tuple[str, ...]) -> None:
    """A negative level is a discrepancy and not an error."""
    selected = [CATALOGUE[name] for name in effects]
    found = islands.diagnose(record[:300], "cascaded-tanks", effects=selected)
    assert found.verdict not in (Verdict.NOTHING, Verdict.GROSS_ERROR)


@pytest.mark.ci
@pytest.mark.parametrize(
    "name", ["column", "python", pytest.param("bouc-wen-piezo", marks=pytest.mark.nightly)]
)
def test_simulation_equal_to_the_record_has_no_discrepancy(record: Dataset, name: str) -> None:
    """The simulation equals the record bit for bit, without noise."""
    record = record[:300]
    columns = {"theirs": 0.8 * record.u[:, 0]}
    y = islands.simulate(SIMULATIONS[name], record, columns=columns).y
    found = islands.diagnose(replace(record, y=y), SIMULATIONS[name], columns=columns)
    assert found.verdict == Verdict.NOTHING
    assert found.effects == ()
    assert found.noise_floor == pytest.approx(0.0, abs=1e-9)


@pytest.mark.ci
def test_cause_is_named_without_noise(record: Dataset) -> None:
    record = record[:300]
    found = islands.diagnose(record, "column:theirs", columns={"theirs": record.y - 1.0})
    assert [each.name for each in found.effects] == ["offset"]
    assert found.effects[0].parameters["c"].value == pytest.approx(1.0)
