"""Latent models of several outputs: both systems are found, files, and searches that continue."""

import json
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import SettingsError
from islands.facade.coupled.identification import StoppedCouplingError
from islands.persistence.checkpoints import (
    archipelago_from_document,
    checkpoint_text,
    state_document,
    state_from_document,
)
from islands.records.coupled import CoupledRecord
from support.latent_systems import curves_record
from support.undrawn import undrawn_figures

#: A search that takes two seconds.
SHORT = {"preset": "latent", "population": 6, "generations": 4, "migrate_every": 2, "islands": 2}


@pytest.fixture(scope="module")
def found():
    return islands.identify(curves_record(300, 1), **SHORT)


@pytest.mark.ci
def test_a_saved_result_is_read_with_the_same_bands(found, tmp_path):
    with undrawn_figures():
        folder = found.save(tmp_path / "result")
    loaded = islands.load(folder)
    assert loaded.best.model == found.best.model
    record = curves_record(200, 5)
    np.testing.assert_array_equal(loaded.bands(record).lower, found.bands(record).lower)
    document = json.loads((folder / "result.json").read_text())
    assert document["ensemble"] is None
    assert all(each["ensemble"] for each in document["outputs"])
    assert "size 18 (one latent model for each output)" in " ".join(str(loaded).split())
    assert loaded.outputs[1].best.model.units == found.outputs[1].best.model.units


@pytest.mark.ci
def test_a_search_that_continues_has_the_same_result(found):
    states = []
    again = islands.identify(
        curves_record(300, 1), on_epoch=lambda state, _settings: states.append(state), **SHORT
    )
    assert again.best.model == found.best.model
    assert [len(state.earlier) for state in states] == [0, 0, 0, 1, 1, 1]
    for state in (states[1], states[4]):
        text = checkpoint_text(state.archipelago, state_document(state))
        stored = state_from_document(*archipelago_from_document(text, "test"))
        assert islands.identify(curves_record(300, 1), start=stored, **SHORT).best.model == found.best.model


@pytest.mark.ci
def test_a_search_that_is_stopped_names_the_outputs_that_are_missing(found):
    calls = iter(range(10_000))
    with pytest.raises(StoppedCouplingError, match="y1") as stopped:
        islands.identify(curves_record(300, 1), stop=lambda: next(calls) >= 0, **SHORT)
    assert (stopped.value.outputs, stopped.value.found) == (("y1", "y2"), ())


@pytest.mark.ci
def test_inputs_that_one_output_reads_at_once_are_read_early_by_all():
    record = curves_record(300, 1)
    first, second = record.records
    direct = CoupledRecord((first, replace(second, y=second.y + 0.5 * first.u[:, 0])))
    result = islands.identify(direct, **SHORT, seed=2)
    assert result.best.model.input_names == ("u+1",)
    for name in ("y1", "y2"):
        assert result.best.metrics[name]["validation"]["free_run"].rmse < 0.05


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "latent", "library": "polynomial"}, "are settings of NARX models"),
        ({"model": "latent", "refit": "all"}, "refit is 'none' with several outputs"),
        ({"model": "latnet"}, "Did you mean 'latent'"),
        ({"structure": "wiener"}, "a structure is a setting of latent models"),
    ],
)
def test_settings_without_effect_are_refused(options, message):
    with pytest.raises(SettingsError, match=message):
        islands.fit(curves_record(60, 1), **options)
