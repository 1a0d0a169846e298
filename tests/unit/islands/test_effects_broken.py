"""Invalid effects: the error names the effect, the reason and the file."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from support.built_in_simulators import make_piezo
from support.simulated_records import recorded, wave

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def record() -> Dataset:
    u = wave()
    y = 0.8 * u + 0.5 + 0.05 * np.random.default_rng(0).standard_normal(u.size)
    return recorded(u, y)


def fail(*_arguments: object) -> None:
    raise RuntimeError("out of order")


VALID = CATALOGUE["offset"]
INVALID: dict[str, tuple[Effect, str]] = {
    "form raises": (replace(VALID, form=fail), "its form fails: RuntimeError: out of order"),
    "form changes the length": (
        replace(VALID, form=lambda y, _values, _context: y[:-1]),
        r"its form gives \(599,\) for \(600,\)",
    ),
    "form returns texts": (
        replace(VALID, form=lambda y, _values, _context: ["a"] * y.size),
        "its form fails: ValueError",
    ),
    "starting points raise": (
        replace(VALID, starting_points=fail),
        "its starting points fail: RuntimeError: out of order",
    ),
    "starting points with too many values": (
        replace(VALID, starting_points=lambda _context, _residual: ((1.0, 2.0),)),
        "each of its starting points needs 1 values",
    ),
    "starting points without values": (
        replace(VALID, starting_points=lambda _context, _residual: ((),)),
        "each of its starting points needs 1 values",
    ),
    "input map raises": (replace(CATALOGUE["delay"], form=fail), "its form fails"),
}


@pytest.mark.parametrize("case", INVALID)
def test_error_names_the_invalid_effect(record: Dataset, case: str) -> None:
    effect, message = INVALID[case]
    with pytest.raises(SettingsError, match=f"the effect {effect.name} is broken: {message}") as raised:
        diagnose(record, make_piezo(), catalogue=(effect, CATALOGUE["jump"]))
    assert str(raised.value).endswith(".py or remove the effect from the catalogue")


@pytest.mark.nightly
def test_effect_without_starting_points_is_skipped(record: Dataset) -> None:
    effect = replace(VALID, starting_points=lambda _context, _residual: ())
    found = diagnose(record, make_piezo(), catalogue=(effect, CATALOGUE["jump"]))
    assert {each.name for each in found.candidates} <= {"jump"}


def test_effects_with_equal_names_are_rejected(record: Dataset) -> None:
    with pytest.raises(SettingsError, match="offset is given twice: rename one"):
        diagnose(record, make_piezo(), catalogue=(VALID, CATALOGUE["jump"], VALID))
