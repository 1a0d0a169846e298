"""What cannot be diagnosed is refused in a line, and what says nothing has a verdict: nothing breaks."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.data.dataset import Dataset
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.inference.verdict import Verdict
from islands.errors import IslandsError, RecordError, SettingsError
from islands.io.simulator_spec.specification import LocalSpec, PhysicalSpec
from support.simulated_records import made, recorded, wave

#: Simulations that take what is not given from the record, and those that are what they are.
ASKED: dict[str, str | LocalSpec] = {
    **{name: name for name in ("bouc-wen-piezo", "second-order", "rigid-axis", "cascaded-tanks", "linear:1")},
    "column": "column:theirs",
    "python": made()["python"].spec,
    "model": made()["model"].spec,
}


@pytest.fixture(scope="module")
def record() -> Dataset:
    u = wave()
    return recorded(u, 0.8 * u + 0.05 * np.random.default_rng(0).standard_normal(u.size))


def with_y(record: Dataset, change: Callable[[np.ndarray], object]) -> Dataset:
    y = np.array(record.y)
    change(y)
    return replace(record, y=y)


def still(record: Dataset, level: float) -> Dataset:
    return replace(record, u=np.full_like(record.u, level))


SPOILT: dict[str, Callable[[Dataset], Dataset]] = {
    "one sample": lambda record: record[:1],
    "two samples": lambda record: record[:2],
    "five samples": lambda record: record[:5],
    "fifty samples": lambda record: record[:50],
    "one too few": lambda record: record[:199],
    "an input that stands still": lambda record: still(record, 2.0),
    "no input": lambda record: still(record, 0.0),
    "an output that stands still": lambda record: with_y(record, lambda y: y.fill(2.0)),
    "no output": lambda record: with_y(record, lambda y: y.fill(0.0)),
    "a gap": lambda record: with_y(record, lambda y: y.__setitem__(slice(100, 110), np.nan)),
    "a gap at its beginning": lambda record: with_y(record, lambda y: y.__setitem__(0, np.nan)),
    "the input as a channel": lambda record: replace(
        record, u=np.repeat(record.u, 2, axis=1), input_names=("u_V", "w_V"), input_units=("V", "V")
    ),
}


@pytest.mark.parametrize("case", SPOILT)
@pytest.mark.parametrize("name", ASKED)
def test_a_record_that_says_nothing_is_refused_by_every_simulation(
    record: Dataset, name: str, case: str
) -> None:
    spoilt = SPOILT[case](record)
    theirs = 0.8 * record.u[: spoilt.samples, 0]
    with pytest.raises(RecordError) as refused:
        islands.diagnose(spoilt, ASKED[name], columns={"theirs": theirs})
    assert len(str(refused.value)) > 20


COLUMNS = {
    "shorter": (lambda theirs: theirs[:100], r"column theirs has the shape \(100,\), the measured output"),
    "two of them": (lambda theirs: np.stack([theirs, theirs], axis=1), r"has the shape \(600, 2\)"),
    "a gap": (lambda theirs: np.where(np.arange(600) == 50, np.nan, theirs), "column theirs has gaps"),
    "a gap where it is locked": (lambda theirs: np.where(np.arange(600) == 590, np.nan, theirs), "has gaps"),
}


@pytest.mark.parametrize("case", COLUMNS)
def test_a_column_of_other_samples_is_refused(record: Dataset, case: str) -> None:
    change, why = COLUMNS[case]
    with pytest.raises(RecordError, match=why):
        islands.diagnose(record, "column:theirs", columns={"theirs": change(0.8 * record.u[:, 0])})


PROGRAMS = {
    "raises": ("def f(u, dt, k=1.0):\n    raise ValueError('no')", "f fails: ValueError: no"),
    "leaves": ("def f(u, dt):\n    raise SystemExit(3)", "f fails: SystemExit: 3"),
    "another length": (
        "def f(u, dt):\n    return u[:3]",
        r"an output of shape \(3,\) for an input of \(600,\)",
    ),
    "a number": ("def f(u, dt):\n    return 1.0", r"of shape \(\)"),
    "a matrix": ("def f(u, dt):\n    return u[:, None]", r"of shape \(600, 1\)"),
    "nothing": ("def f(u, dt):\n    pass", r"of shape \(\)"),
    "texts": ("def f(u, dt):\n    return ['a'] * len(u)", "could not convert"),
    "no numbers": ("def f(u, dt):\n    return u * float('nan')", "diverges on this input"),
    "a parameter without a number": ("def f(u, dt, k):\n    return u", "k needs a number for its default"),
    "a parameter that is a text": ("def f(u, dt, k='a'):\n    return u", "k needs a number"),
    "a parameter without end": ("def f(u, dt, k=float('inf')):\n    return u", "k needs a number"),
    "any parameters": ("def f(u, dt, **more):\n    return u", "more needs a number"),
    "one argument": ("def f(u):\n    return u", r"has to take \(u, dt\)"),
    "nobody knows which": ("f = max", "nobody knows what .* takes"),
    "no function": ("g = 1", "has no function 'f'"),
    "no callable": ("f = 1", "has no function 'f'"),
    "no Python": ("def f(", "cannot be run: SyntaxError"),
    "leaves at once": ("raise SystemExit(3)", "cannot be run: SystemExit"),
}


@pytest.mark.parametrize("case", PROGRAMS)
def test_a_program_that_does_not_simulate_is_refused(record: Dataset, tmp_path: Path, case: str) -> None:
    text, why = PROGRAMS[case]
    path = tmp_path / "theirs.py"
    path.write_text(text)
    with pytest.raises(IslandsError, match=why):
        islands.diagnose(record, f"python:{path}:f")


def test_a_program_that_is_not_there_is_refused(record: Dataset) -> None:
    with pytest.raises(SettingsError, match=r"nowhere\.py cannot be run"):
        islands.diagnose(record, "python:nowhere.py:f")


@pytest.mark.parametrize(
    ("text", "why"),
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
def test_what_cannot_be_asked_for_is_refused(record: Dataset, text: str, why: str) -> None:
    with pytest.raises(IslandsError, match=why):
        islands.diagnose(record, text)


@pytest.mark.parametrize(
    ("kind", "parameters", "why"),
    [
        ("second-order", {"mass": 1.0}, "there is no parameter mass: the parameters are m, c, k"),
        ("second-order", {"m": 0.0}, "a mass of zero"),
        ("second-order", {"m": 1e-300}, "diverges on this input"),
        ("rigid-axis", {"k": 1.0}, "there is no parameter k: the parameters are m, c, F, vs"),
        ("rigid-axis", {"m": 0.0}, "m = 0 is no such system's: give a positive value"),
        ("rigid-axis", {"F": -1.0}, "F = -1 is no such"),
        ("cascaded-tanks", {"k2": 0.0}, "k2 = 0 is no such"),
        ("cascaded-tanks", {"k4": 1.0}, "there is no parameter k4"),
        ("bouc-wen-piezo", {"gamma": -5.0}, "diverges on this input: check its parameters"),
    ],
)
def test_parameters_that_no_such_system_has_are_refused(
    record: Dataset, kind: str, parameters: dict[str, float], why: str
) -> None:
    with pytest.raises(IslandsError, match=why), np.errstate(all="ignore"):
        islands.diagnose(record, PhysicalSpec(kind=kind, parameters=parameters))


def test_an_axis_says_how_long_a_record_has_to_be(record: Dataset) -> None:
    with pytest.raises(RecordError, match="an axis needs 80 samples, the record has 50"):
        islands.diagnose(record[:50], "rigid-axis")


#: What is looked for at the level ci; at the nightly level it is the whole catalogue.
FEW = ("delay", "offset", "cubic-stiffness")


@pytest.mark.parametrize(
    "effects",
    [pytest.param(FEW, marks=pytest.mark.ci), pytest.param(tuple(CATALOGUE), marks=pytest.mark.nightly)],
    ids=len,
)
def test_tanks_below_their_bottom_have_a_verdict(record: Dataset, effects: tuple[str, ...]) -> None:
    """No tank has a level below zero: this is a discrepancy, and not an error."""
    chosen = [CATALOGUE[name] for name in effects]
    found = islands.diagnose(record[:300], "cascaded-tanks", effects=chosen)
    assert found.verdict in (Verdict.UNKNOWN, Verdict.NAMED, Verdict.REMAINDER)


@pytest.mark.parametrize("name", ["column", "python", "bouc-wen-piezo"])
def test_a_simulation_that_is_the_record_lacks_nothing(record: Dataset, name: str) -> None:
    """The simulation is the record to the last bit: there is no noise, and nothing that could be fitted."""
    record = record[:300]
    columns = {"theirs": 0.8 * record.u[:, 0]}
    y = islands.simulate(ASKED[name], record, columns=columns).y
    found = islands.diagnose(replace(record, y=y), ASKED[name], columns=columns)
    assert found.verdict == Verdict.NOTHING
    assert found.effects == ()
    assert found.noise_floor == pytest.approx(0.0, abs=1e-9)


@pytest.mark.ci
def test_without_noise_a_cause_is_named_all_the_same(record: Dataset) -> None:
    record = record[:300]
    found = islands.diagnose(record, "column:theirs", columns={"theirs": record.y - 1.0})
    assert [each.name for each in found.effects] == ["offset"]
    assert found.effects[0].parameters["c"].value == pytest.approx(1.0)
