"""Free runs of coupled models: exact for the true model, and equal to those of single models."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import RecordError, SettingsError
from islands.export import export
from islands.models.coupled_narx import CoupledModel, measured_coupled_model
from islands.persistence.models import read_model, write_model
from islands.records.averaging import average_samples
from islands.records.coupled import CoupledRecord, match_coupled
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess
from islands.records.signal_map import match_rate
from islands.simulation.outcome import Status
from islands.simulation.predictors import free_run, multiple_shooting
from support.coupled_systems import PREY, TWO_MASSES, equation, make_coupled_record, simulate_scalar

DECOUPLED = CoupledModel(
    (
        equation(
            {"y(k-1)": 0.8, "tanh(mul(u1(k-1), y(k-3)))": 0.4, "mul(u1(k-1), u1(k-2), y(k-1))": -0.2},
            ("u", "y2"),
            "y1",
        ),
        equation({"y(k-2)": 0.5, "sign(sub(u1(k-1), u1(k-2)))": 0.3, "1": 0.1}, ("u", "y1"), "y2"),
    )
)


@pytest.mark.parametrize("segments", [(), (150, 250), (40,) * 10])
def test_a_decoupled_model_has_the_bits_of_its_single_models(segments) -> None:
    record = make_coupled_record(DECOUPLED, noise=0.1, segments=segments)
    coupled = free_run(DECOUPLED, record, warm_up=4)
    for place, single in enumerate(DECOUPLED.models):
        alone = free_run(single, record.separate(place), warm_up=4)
        np.testing.assert_array_equal(coupled.y[:, place], alone.y)
        assert coupled.mean_squared_errors[place] == pytest.approx(alone.mean_squared_error, rel=1e-12)


@pytest.mark.parametrize("model", [TWO_MASSES, PREY])
def test_a_free_run_equals_a_simulation_with_python_floats(model) -> None:
    record = make_coupled_record(model, noise=0.05)
    warm_up = model.maximum_lag
    expected = simulate_scalar(model, record.records[0].u, record.y[:warm_up])
    np.testing.assert_array_equal(free_run(model, record).y[warm_up:], expected[warm_up:])


def test_a_divergence_ends_all_outputs_of_its_segment_only() -> None:
    unstable = TWO_MASSES.with_parameters((1.6, -0.8, 0.1, 5e3, 1.5, 3.0, 0.12, -0.04))
    record = make_coupled_record(TWO_MASSES, segments=(300, 100))
    simulated = free_run(unstable, record)
    assert simulated.outcome.verdict is Status.DIVERGED
    first = int(simulated.outcome.reason.rpartition(" ")[2])
    assert np.isfinite(simulated.y[2:first]).all()
    assert np.isnan(simulated.y[first:300]).all()
    assert np.isfinite(simulated.y[302]).all()
    assert simulated.mean_squared_errors == (np.inf, np.inf)


def test_outputs_and_inputs_are_matched_by_name() -> None:
    record = make_coupled_record(TWO_MASSES, noise=0.05)
    turned = CoupledRecord(record.records[::-1])
    np.testing.assert_array_equal(free_run(TWO_MASSES, turned).y, free_run(TWO_MASSES, record).y)
    strange = CoupledRecord((record.records[0], replace(record.records[1], output_name="x")))
    with pytest.raises(RecordError, match="name the same outputs"):
        free_run(TWO_MASSES, strange)


def test_an_input_read_one_sample_early_is_advanced() -> None:
    terms = {"y(k-1)": 0.5, "u1(k-1)": 1.0, "u2(k-1)": 0.2}
    early = CoupledModel(
        (equation(terms, ("u+1", "b"), "a"), equation(terms, ("u+1", "a"), "b")),
    )
    u = np.random.default_rng(3).normal(size=50)
    y = simulate_scalar(early, np.append(u[1:], 0.0), np.zeros((1, 2)))
    record = CoupledRecord(
        tuple(Dataset(u, y[:, place], 0.1, ("u",), name) for place, name in enumerate("ab"))
    )
    np.testing.assert_allclose(free_run(early, record).y[1:], y[1:], rtol=1e-14)


def test_a_short_warm_up_and_a_bad_interval_are_refused() -> None:
    record = make_coupled_record(TWO_MASSES)
    with pytest.raises(SettingsError, match="reads 2 samples back"):
        free_run(TWO_MASSES, record, warm_up=1)
    with pytest.raises(SettingsError, match="at least 1 sample"):
        multiple_shooting(TWO_MASSES, record, 0)


# Preprocessing: the measured record gives the simulation of the search with the offsets of the outputs.

STEPS = ({"detrend": "constant"}, {"lowpass": 1.0}, {"lowpass": 1.0, "decimate": 3, "detrend": "constant"})


def measured_record():
    record = make_coupled_record(TWO_MASSES, noise=0.01)
    return record.map(
        lambda each: replace(each, u=each.u + 4.0, y=each.y + 7.0 * (1 + (each.output_name == "y2")))
    )


def preprocessed(steps, average=1):
    """Return the record of a search, a model of it, and its simulation with the offsets of the outputs."""
    prepared = measured_record().map(lambda each: average_samples(preprocess(each, **steps), average))
    dt = prepared.dt
    model = CoupledModel(
        tuple(
            replace(single, dt=dt, average=average, preprocessing=prepared.separate(place).preprocessing)
            for place, single in enumerate(TWO_MASSES.models)
        )
    )
    without = CoupledModel(tuple(replace(single, preprocessing=None, average=1) for single in model.models))
    offsets = [each.preprocessing.output_offset for each in prepared.records]
    return prepared, model, free_run(without, prepared).y + offsets


def written_and_read(model, folder):
    write_model(model, folder / "model.json")
    return read_model(folder / "model.json")


def run_python(model, record, _folder):
    module = {}
    exec(export(model, "python"), module)
    data = match_coupled(model, record.map(lambda each: match_rate(model, each)))
    found = np.transpose(module["simulate"](*data.records[0].u.T.tolist(), *data.y.T.tolist()))
    found[: model.maximum_lag] = np.nan
    return found


COUPLED_PATHS = {
    "measured record": lambda model, record, _: free_run(model, record).y,
    "at the rate of the model": lambda model, record, _: (
        free_run(model, record.map(lambda each: match_rate(model, each))).y
    ),
    "outputs in another order": lambda model, record, _: (
        free_run(model, CoupledRecord(record.records[::-1])).y
    ),
    "file": lambda model, record, folder: free_run(written_and_read(model, folder), record).y,
    "measured units": lambda model, record, _: free_run(measured_coupled_model(model), record).y,
    "python": run_python,
}


@pytest.mark.parametrize("path", COUPLED_PATHS.values(), ids=COUPLED_PATHS)
@pytest.mark.parametrize("average", [1, 2])
@pytest.mark.parametrize("steps", STEPS, ids=str)
def test_every_path_gives_the_outputs_of_the_search(steps, average, path, tmp_path) -> None:
    _, model, expected = preprocessed(steps, average)
    np.testing.assert_allclose(path(model, measured_record(), tmp_path), expected, rtol=1e-9)


@pytest.mark.ci
def test_a_coupled_fit_of_deviations_simulates_the_measured_record() -> None:
    prepared = measured_record().map(lambda each: preprocess(each, detrend="constant"))
    result = islands.fit(prepared, validation=0.25, max_terms=3, certificate=0)
    assert any(result.best.model.preprocessing.input_offsets)
    offsets = [each.preprocessing.output_offset for each in prepared.records]
    expected = result.simulate(prepared).y + offsets
    np.testing.assert_allclose(result.simulate(measured_record()).y, expected, rtol=1e-9)
