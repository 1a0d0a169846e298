"""Several outputs: the true equations, one free run, and settings that are for one output only."""

import json
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import ModelError, RecordError, SettingsError
from islands.evolution.search_state import SearchState
from islands.persistence.checkpoints import (
    archipelago_from_document,
    checkpoint_text,
    state_document,
    state_from_document,
)
from islands.progress import StoppedError
from support.coupled_systems import PREY, TWO_MASSES, make_coupled_record
from support.undrawn import undrawn_figures

pytestmark = pytest.mark.ci

#: A small search.
FAST = {"degree": 2, "lags": 2, "max_terms": 4, "average": 1, "certificate": 0}


@pytest.fixture(scope="module")
def found():
    return islands.fit(make_coupled_record(PREY, samples=150), **FAST)


@pytest.mark.parametrize("search", [islands.fit, islands.identify])
def test_an_extrapolating_input_is_one_warning_and_outputs_are_none(search) -> None:
    record = make_coupled_record(PREY, samples=150)
    wide = make_coupled_record(PREY, samples=100).map(
        lambda each: replace(each, u=np.tile([[9.0]], (100, record.u.shape[1])), y=5.0 * each.y)
    )
    with pytest.warns(islands.ExtrapolationWarning) as warned, pytest.raises(StoppedError):
        search(record, validation=wide, stop=lambda: True)
    named = [str(each.message) for each in warned]
    assert len(named) == len(record.input_names)
    for name, message in zip(record.input_names, named, strict=True):
        assert message.startswith(f"validation extrapolates: {name} is 9 to 9")
    assert {each.filename for each in warned} == {__file__}


def test_without_noise_the_true_equations_are_found() -> None:
    linear = islands.fit(
        make_coupled_record(TWO_MASSES, samples=150), **(FAST | {"degree": 1, "max_terms": 4})
    )
    for chosen, true in zip(linear.best.model.models, TWO_MASSES.models, strict=True):
        assert chosen.regressors == true.regressors
        np.testing.assert_allclose(chosen.parameters, true.parameters, rtol=1e-6)


def test_a_result_of_several_outputs_takes_frames_and_inputs_alone(found) -> None:
    data = found.best.validation
    frame = {"u": data.u[:, 0], **{each.output_name: each.y for each in data.records}}
    assert found.simulate(frame).y.tobytes() == found.simulate(data).y.tobytes()
    lag = found.best.model.maximum_lag
    assert np.array_equal(found.predict(frame), found.simulate(data, warm_up=lag).y, equal_nan=True)
    from_rest = found.simulate({"u": data.u[:, 0]}, y=[0.1, 0.2]).y
    stepper = found.stepper(data.u[0], [0.1, 0.2])
    assert np.array([stepper.step(each) for each in data.u]).tobytes() == from_rest.tobytes()
    table = found.to_pandas()
    assert table.index.tolist() == [(1, "y1"), (1, "y2")]
    assert table.rmse_val.tolist() == [
        found.best.metrics[name]["validation"]["free_run"].rmse for name in ("y1", "y2")
    ]
    assert "<math" in found._repr_html_()


def test_the_summary_states_the_linear_system_in_the_middle_of_the_data(found) -> None:
    system = found.linearise()
    (low, high), *_ = found.best.prediction_bands.outputs[0].data_range.inputs
    assert system.operating_inputs == (0.5 * (low + high),)
    text = " ".join(str(found).split())
    assert f"Linear part about {system.describe_point()}: {'; '.join(system.describe())}." in text


@pytest.mark.ci
def test_a_saved_result_is_read_with_the_same_simulation(found, tmp_path) -> None:
    with undrawn_figures():
        folder = found.save(tmp_path / "result")
    loaded = islands.load(folder)
    assert (loaded.best.model, loaded.best.warm_up) == (found.best.model, found.best.warm_up)
    assert loaded.best.metrics == found.best.metrics
    assert str(loaded) == str(found) == (folder / "summary.txt").read_text()
    data = found.best.validation
    np.testing.assert_array_equal(loaded.bands(data).lower, found.bands(data).lower)
    assert "terms simulates y1 with a" in loaded.report(tmp_path / "report.html").read_text()
    document = json.loads((folder / "result.json").read_text())
    assert [each["name"] for each in document["outputs"]] == ["y1", "y2"]
    for number, each in enumerate(document["outputs"], start=1):
        separate = json.loads((folder / each["folder"] / "result.json").read_text())
        assert separate["schema"] == document["schema"] == "islands.result/1"
        assert (folder / "figures" / f"free-run-{number}.svg").exists()
    assert "y1(k) =" in (folder / "summary.txt").read_text()
    assert [each.output_names for each in loaded.outputs] == [("y1",), ("y2",)]


@pytest.mark.nightly
def test_an_evolution_continues_from_the_stored_state_of_every_output() -> None:
    record = make_coupled_record(PREY, samples=150)
    settings = {"population": 8, "generations": 2, "max_terms": 3, "average": 1, "library_degree": 2}
    states: list[SearchState] = []
    whole = islands.identify(record, seed=3, on_epoch=lambda state, _: states.append(state), **settings)
    assert [len(state.earlier) for state in states] == [0, 0, 1, 1]
    for state in (states[0], states[3]):
        text = checkpoint_text(state.archipelago, state_document(state))
        stored = state_from_document(*archipelago_from_document(text, "test"))
        assert len(stored.earlier) == len(state.earlier)
        again = islands.identify(record, seed=3, start=stored, **settings)
        assert again.best.model == whole.best.model


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"constraints": "gain = 2"}, "each equation numbers its inputs differently"),
        ({"feedthrough": "yes"}, r"as u\+1"),
        ({"library": "cubic"}, "library"),
    ],
)
def test_settings_for_one_output_are_refused(options, message) -> None:
    with pytest.raises(SettingsError, match=message):
        islands.fit(make_coupled_record(PREY), **options)


def test_a_choice_by_fitness_is_refused() -> None:
    with pytest.raises(SettingsError, match="by their free run together"):
        islands.identify(make_coupled_record(PREY), select="fitness")


def test_both_parts_of_the_data_have_the_same_outputs() -> None:
    record = make_coupled_record(PREY)
    one = record.records[0]
    for given, validation in ((record, one), (one, record)):
        with pytest.raises(RecordError, match="the same outputs"):
            islands.fit(given, validation=validation)


def test_arrays_frames_and_a_record_of_several_outputs_have_one_result(found) -> None:
    record = make_coupled_record(PREY, samples=150)
    frame = {"u": record.u[:, 0], "y1": record.y[:, 0], "y2": record.y[:, 1]}
    for result in (
        islands.fit(record.u[:, 0], record.y, record.dt, **FAST),
        islands.fit(frame, inputs="u", output=["y1", "y2"], dt=record.dt, **FAST),
    ):
        assert result.best.model == found.best.model


def test_results_of_several_outputs_are_compared_by_output(found) -> None:
    other = islands.fit(make_coupled_record(PREY, samples=150), **(FAST | {"degree": 1}))
    table = found.compare(other, names=("curved", "linear"))
    assert [(row.result, row.output) for row in table.recommended] == [
        ("curved", "y1"),
        ("curved", "y2"),
        ("linear", "y1"),
        ("linear", "y2"),
    ]
    again = found.compare(other, found.best.validation).recommended
    for row, error in zip(again, table.recommended, strict=True):
        assert row.rmse == error.rmse


def test_what_is_known_of_one_output_only_says_where_it_is(found) -> None:
    for read in (lambda: found.best.physics, found.best.to_sympy):
        with pytest.raises(ModelError, match="outputs"):
            read()
    assert found.outputs[0].best.physics is not None
