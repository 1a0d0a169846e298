"""Blocks: texts of coupled models, and the start of their states."""

from dataclasses import replace

import pytest

from islands.errors import SettingsError
from islands.export import EXPORTS, export
from islands.models.coupled_narx import CoupledModel
from islands.models.measured_signals import measured_block
from support.block_cases import OF_BLOCKS
from support.coupled_systems import PREY, TWO_MASSES


def test_equations_name_the_columns_of_the_record() -> None:
    assert export(TWO_MASSES, "plain").splitlines() == [
        "y1(k) = 1.6*y1(k-1) - 0.8*y1(k-2) + 0.1*u(k-1) + 0.05*y2(k-1)",
        "y2(k) = 1.5*y2(k-1) - 0.7*y2(k-2) + 0.12*y1(k-1) - 0.04*y1(k-2)",
    ]


def test_latex_and_mathml_number_the_outputs() -> None:
    rows = export(PREY, "latex").splitlines()
    assert rows[0] == r"\begin{aligned}"
    assert rows[1].startswith("y_{1,k} &= ")
    assert "y_{2,k-1}" in rows[1]
    assert "u_{k-1}" in rows[1]
    first, second = export(PREY, "mathml").splitlines()
    assert "<mi>y</mi><mrow><mn>2</mn><mo>,</mo><mi>k</mi>" in first
    assert "<mi>u</mi><mrow><mi>k</mi>" in first
    assert "<mi>u</mi>" not in second


def test_an_unknown_format_names_the_others() -> None:
    with pytest.raises(SettingsError, match=r"'fortran'.* plain, latex"):
        export(PREY, "fortran")
    renamed = CoupledModel(tuple(replace(each) for each in PREY.models))
    assert all(export(renamed, kind) for kind in EXPORTS)


def test_a_state_space_starts_at_rest_at_its_operating_point() -> None:
    block = measured_block(OF_BLOCKS["state space of deviations"])
    y, *states, u = block.start_values()
    assert u == 20.0 + 0.1
    assert block.first_states() == pytest.approx(states, abs=1e-12)
    assert y == pytest.approx(3.7 + 0.3 + 1.2 * states[0])
