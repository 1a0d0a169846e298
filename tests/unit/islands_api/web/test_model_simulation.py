"""Inputs, initial output and warnings of a simulation of a stored model."""

import gzip
import json
from typing import Any

import numpy as np
import pytest

import islands
from islands.persistence.models import model_json
from islands_api.simulation_schemas import SimulationRequest
from islands_api.web.model_simulation import (
    SimulatedModel,
    describe_start,
    find_first_outputs,
    find_start,
    make_inputs,
    read_simulated_model,
    simulate_inputs,
    write_document,
)
from islands_service.store.results import StoredModel
from support.latent_systems import make_model as make_latent

NAMES = ("u_V", "T_K")
MODEL = islands.make_model(
    [(islands.parse("y(k-1)"), 0.5), (islands.parse("u1(k-1)"), 1.0), (islands.parse("u2(k-1)"), 0.1)],
    NAMES,
    "y_um",
    dt=0.1,
)
FOUND = SimulatedModel(MODEL, ("V", "K", "um"), ((-1.0, 3.0), (280.0, 300.0)), 5.0)
HYSTERESIS = islands.make_model([(islands.parse("y(k-1)"), 1.0), (islands.parse("u(k-1) - u(k-2)"), 0.8)])


def make(inputs: Any, found: SimulatedModel = FOUND, **fields: Any) -> Any:
    u, _ = make_inputs(found, SimulationRequest(inputs=inputs, **fields), None)
    return u


def test_inputs_that_are_not_given_are_held_in_the_middle_of_their_range() -> None:
    assert make({"u_V": [1.0, 2.0]}).tolist() == [[1.0, 290.0], [2.0, 290.0]]
    assert make({}).shape == (2000, 2)


def test_a_result_without_ranges_needs_all_inputs() -> None:
    without = SimulatedModel(MODEL, ("V", "K", "um"), (), 0.0)
    with pytest.raises(islands.SettingsError, match=r'give this input, for example \{"T_K"'):
        make({"u_V": [1.0]}, without)
    document = simulate_inputs(without, make({"u_V": [1.0], "T_K": [9.0]}, without), (0.0,), False, "", ())
    assert (document["ranges"], document["warnings"]) == ({}, [])


def test_every_wave_starts_at_its_offset_so_that_sliders_keep_the_initial_state() -> None:
    for kind in ("sine", "triangle", "steps"):
        wave = {"kind": kind, "amplitude": 7.0, "offset": 1.5, "frequency": 0.3}
        assert make({"u_V": wave}, samples=50)[0, 0] == 1.5


def test_a_model_of_a_stored_result_has_its_ranges_and_units() -> None:
    document = {
        "record": {"units": {"inputs": ["V", "K"], "output": "um"}},
        "data": {"inputs": {"estimation": [[-1.0, 3.0], [280.0, 300.0]]}, "output_range": 5.0},
    }
    assert read_simulated_model(StoredModel(1, {}, model_json(MODEL)), document) == FOUND


def test_the_initial_output_is_given_or_an_equilibrium_or_measured() -> None:
    assert find_start(FOUND, [1.0, 10.0], None).outputs == pytest.approx((4.0,))
    given, _, reason = find_start(FOUND, [1.0, 10.0], 7.0)
    assert describe_start(FOUND, given, reason) == "before the first sample y_um is 7 um, as given"
    assert given == (7.0,)
    resting = SimulatedModel(HYSTERESIS, ("", ""), (), 0.0)
    start, _, reason = find_start(resting, [1.0], None)
    assert start is None
    assert "first measured value of the record, since the model has no unique equilibrium" in reason
    assert find_first_outputs(islands.Dataset(np.zeros(3), np.array([np.nan, 2.0, 3.0]), 1.0)) == (2.0,)


def test_a_latent_model_starts_with_all_states_at_rest() -> None:
    resting = SimulatedModel(make_latent(operating_inputs=(0.5,)), ("V", "mm"), (), 1.0)
    start = find_start(resting, [0.2], None)
    assert start.is_rest
    assert start.outputs is not None
    document = simulate_inputs(resting, np.full((30, 1), 0.2), start.outputs, True, "", ())
    assert document["outputs"]["y_mm"] == pytest.approx([*start.outputs] * 30, abs=1e-9)


def test_warnings_name_the_input_and_the_divergence() -> None:
    unstable = islands.make_model([(islands.parse("y(k-1)"), 9.0), (islands.parse("u(k-1)"), 1.0)], dt=1.0)
    found = SimulatedModel(unstable, ("", ""), ((0.0, 1.0),), 1.0)
    document = simulate_inputs(found, np.full((50, 1), 2.0), (0.0,), False, "", ("before",))
    first, left, diverged = document["warnings"]
    assert first == "before"
    assert left == "u is 2 to 2 in this response and 0 to 1 in the estimation data"
    assert diverged == document["outcome"]
    assert diverged.startswith("diverged: |y| left")


def test_the_document_has_null_after_a_divergence_and_every_digit_before() -> None:
    document = {"output": [0.1 + 0.2, float("nan"), 1e-310, 5.0]}
    written = write_document(document, compressed=False)
    assert json.loads(written) == {"output": [0.1 + 0.2, None, 1e-310, 5.0]}
    assert gzip.decompress(write_document(document, compressed=True)) == written
