"""An entry of the catalogue that does not do what it says is named, with what to do about it."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.errors import SettingsError
from support.simulated_records import recorded, wave


@pytest.fixture(scope="module")
def record() -> Dataset:
    u = wave()
    y = 0.8 * u + 0.5 + 0.05 * np.random.default_rng(0).standard_normal(u.size)
    return recorded(u, y)


def raises(*_arguments: object) -> None:
    raise RuntimeError("out of order")


GOOD = CATALOGUE["offset"]
BROKEN: dict[str, tuple[Effect, str]] = {
    "its form raises": (replace(GOOD, form=raises), "its form fails: RuntimeError: out of order"),
    "its form gives another length": (
        replace(GOOD, form=lambda y, _values, _scene: y[:-1]),
        r"its form gives \(599,\) for \(600,\)",
    ),
    "its form gives no numbers": (
        replace(GOOD, form=lambda y, _values, _scene: ["a"] * y.size),
        "its form fails: ValueError",
    ),
    "its grid raises": (replace(GOOD, starting_points=raises), "its grid fails: RuntimeError: out of order"),
    "its grid has too many values": (
        replace(GOOD, starting_points=lambda _scene, _residual: ((1.0, 2.0),)),
        "its grid has to give 1 values at each point",
    ),
    "its grid has none": (
        replace(GOOD, starting_points=lambda _scene, _residual: ((),)),
        "its grid has to give 1 values",
    ),
    "its map of the input raises": (replace(CATALOGUE["delay"], form=raises), "its form fails"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_effect_is_named(record: Dataset, case: str) -> None:
    effect, why = BROKEN[case]
    with pytest.raises(SettingsError, match=f"the effect {effect.name} is broken: {why}") as refused:
        diagnose(record, BoucWenPiezoSimulator(), catalogue=(effect, CATALOGUE["jump"]))
    assert str(refused.value).endswith(".py or take it out of the catalogue")


def test_a_grid_without_points_leaves_an_effect_out(record: Dataset) -> None:
    effect = replace(GOOD, starting_points=lambda _scene, _residual: ())
    found = diagnose(record, BoucWenPiezoSimulator(), catalogue=(effect, CATALOGUE["jump"]))
    assert {each.name for each in found.candidates} <= {"jump"}


def test_effects_of_one_name_are_refused(record: Dataset) -> None:
    with pytest.raises(SettingsError, match="offset is given twice: rename one"):
        diagnose(record, BoucWenPiezoSimulator(), catalogue=(GOOD, CATALOGUE["jump"], GOOD))
