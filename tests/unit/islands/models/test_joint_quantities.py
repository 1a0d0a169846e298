"""Modes and gains of several outputs: each once, with the spread of an ensemble."""

from dataclasses import replace

import numpy as np
import pytest

from islands.models.joint_quantities import list_joint_quantities
from support.block_cases import OF_BLOCKS


def test_a_state_that_does_not_respond_has_no_mode():
    moving = OF_BLOCKS["shared states"]
    model = replace(
        moving, models=tuple(replace(each, operating_inputs=(0.0, 0.0)) for each in moving.models)
    )
    found = list_joint_quantities(model, [])
    # Of three states, the amplitude of the inputs has a kink at rest.
    assert [each["name"] for each in found if each["input"] is None] == ["frequency", "damping ratio"]
    gains = [each["value"] for each in found if each["name"] == "static gain"]
    np.testing.assert_array_equal(gains, model.linearise().static_gain.ravel())
    assert {each["standard_error"] for each in found} == {None}


def test_standard_errors_are_the_spread_of_the_members():
    model = OF_BLOCKS["shared states"]
    at = model.parameter_names.index("a1_1")
    moved = np.tile(model.parameters, (2, 1))
    moved[:, at] += (1e-3, -1e-3)
    found = list_joint_quantities(model, moved.tolist())
    systems = [model.with_parameters(each).linearise() for each in moved.tolist()]
    spread = np.ptp([np.abs(each.poles[0]) for each in systems]) / 2
    assert 1e-4 < spread < 1e-3
    gain = next(each for each in found if each["name"] == "static gain")
    values = [each.static_gain[0, 0] for each in systems]
    assert gain["standard_error"] == pytest.approx(np.ptp(values) / 2, rel=1e-2)
    assert all(each["standard_error"] > 0.0 for each in found if each["output"] == 1)


def test_outputs_that_share_poles_have_each_mode_once():
    model = OF_BLOCKS["shared poles with dead times"]
    found = list_joint_quantities(model, [])
    assert [each["name"] for each in found if each["input"] is None] == ["time constant"] * 2
    assert [each["output"] for each in found if each["name"] == "dead time"] == [1, 1, 2, 2]
