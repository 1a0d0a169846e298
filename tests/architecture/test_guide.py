"""The guides of the diagnosis agree with the code: effects, simulations and verdicts."""

import re

import numpy as np
import pytest

from islands.discrepancy.effects import CATALOGUE, OF_EACH
from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.effect import SimulationContext
from islands.io.simulator_spec.specification import SIMULATORS
from support.repository import DOCS

DIAGNOSE = (DOCS / "how-to" / "diagnose-a-simulation.md").read_text()

#: Cells of a row of the table of effects by name: parameters, similar effects, distinguishing observation.
ROWS = {
    name: [cell.strip() for cell in cells.split("|")]
    for name, cells in re.findall(
        r"^\| `([a-z-]+)` \|((?:[^|]+\|){2}[^|]+) \|$",
        (DOCS / "how-to" / "tell-effects-apart.md").read_text(),
        re.MULTILINE,
    )
}


def test_the_table_of_effects_has_every_effect_and_no_other() -> None:
    assert ROWS.keys() == {*CATALOGUE, *OF_EACH, *DETECTORS}


@pytest.mark.parametrize("name", [*CATALOGUE, *OF_EACH, *DETECTORS])
def test_every_row_of_the_table_of_effects_is_complete(name: str) -> None:
    parameters, alike, apart = ROWS[name]
    assert parameters
    assert alike
    assert apart


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_table_of_effects_has_the_parameters_of_an_effect(name: str, scene: SimulationContext) -> None:
    in_guide = re.findall(r"`([^`]+)`", ROWS[name][0])
    assert [each.name for each in CATALOGUE[name].parameters(scene)] == in_guide


def test_the_guide_of_the_diagnosis_has_every_simulation_and_every_verdict() -> None:
    assert not [kind for kind in SIMULATORS if not re.search(rf"^\| `{kind}[\[:`]", DIAGNOSE, re.MULTILINE)]
    assert not [verdict for verdict in Verdict if f"| `{verdict}` |" not in DIAGNOSE]


@pytest.fixture(scope="module")
def scene() -> SimulationContext:
    u = np.sin(np.arange(400) / 20)
    return SimulationContext(u, 0.01, {"T": u, "w": u}, {"T": "K", "w": "V"}, 1.0, 1.0, "V", "um", 3.0)
