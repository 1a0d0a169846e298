"""Free runs of coupled models: exact for the true model, and equal to those of single models."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.averaging import average_samples
from islands.data.coupled_record import CoupledRecord
from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.simulation.coupled_free_run import CoupledSimulator, coupled_free_run
from islands.simulation.coupled_model import CoupledModel
from islands.simulation.outcome import Status
from islands.simulation.predictors import free_run
from support.coupled_systems import PREY, TWO_MASSES, equation, make_coupled_record, simulate_scalar

#: Equations that do not read the other output, with products, calls and constants.
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
    coupled = coupled_free_run(DECOUPLED, record, warm_up=4)
    for place, single in enumerate(DECOUPLED.models):
        alone = free_run(single, record.separate(place), warm_up=4)
        np.testing.assert_array_equal(coupled.y[:, place], alone.y)
        assert coupled.mean_squared_errors[place] == pytest.approx(alone.mean_squared_error, rel=1e-12)


@pytest.mark.parametrize("model", [TWO_MASSES, PREY])
def test_a_free_run_equals_a_simulation_with_python_floats(model) -> None:
    record = make_coupled_record(model, noise=0.05)
    warm_up = model.maximum_lag
    expected = simulate_scalar(model, record.records[0].u, record.y[:warm_up])
    np.testing.assert_array_equal(coupled_free_run(model, record).y[warm_up:], expected[warm_up:])


def test_a_free_run_reads_the_outputs_in_the_warm_up_only() -> None:
    record = make_coupled_record(TWO_MASSES, noise=0.05)
    known = np.arange(record.samples) < TWO_MASSES.maximum_lag
    blind = record.map(lambda each: replace(each, y=np.where(known, each.y, np.nan)))
    simulated = coupled_free_run(TWO_MASSES, blind)
    np.testing.assert_array_equal(simulated.y, coupled_free_run(TWO_MASSES, record).y)
    assert np.isnan(simulated.mean_squared_errors).all()


def test_an_interval_of_one_sample_is_the_prediction_one_step_ahead() -> None:
    record = make_coupled_record(PREY, noise=0.05)
    steps = CoupledSimulator(PREY, record, 1)(np.array(PREY.parameters))
    expected = simulate_scalar(PREY, record.records[0].u[:10], record.y[:9])
    np.testing.assert_array_equal(steps.y[9], expected[9])


def test_a_divergence_ends_all_outputs_of_its_segment_only() -> None:
    unstable = TWO_MASSES.with_parameters((1.6, -0.8, 0.1, 5e3, 1.5, 3.0, 0.12, -0.04))
    record = make_coupled_record(TWO_MASSES, segments=(300, 100))
    simulated = coupled_free_run(unstable, record)
    assert simulated.outcome.verdict is Status.DIVERGED
    first = int(simulated.outcome.reason.rpartition(" ")[2])
    assert np.isfinite(simulated.y[2:first]).all()
    assert np.isnan(simulated.y[first:300]).all()
    assert np.isfinite(simulated.y[302]).all()
    assert simulated.mean_squared_errors == (np.inf, np.inf)


def test_means_are_simulated_from_the_samples_of_the_record() -> None:
    means = CoupledModel(tuple(replace(each, average=2, dt=0.2) for each in TWO_MASSES.models))
    record = make_coupled_record(TWO_MASSES)
    averaged = record.map(lambda each: average_samples(each, 2))
    np.testing.assert_array_equal(coupled_free_run(means, record).y, coupled_free_run(means, averaged).y)


def test_outputs_and_inputs_are_matched_by_name() -> None:
    record = make_coupled_record(TWO_MASSES, noise=0.05)
    turned = CoupledRecord(record.records[::-1])
    np.testing.assert_array_equal(
        coupled_free_run(TWO_MASSES, turned).y, coupled_free_run(TWO_MASSES, record).y
    )
    strange = CoupledRecord((record.records[0], replace(record.records[1], output_name="x")))
    with pytest.raises(RecordError, match="name the same outputs"):
        coupled_free_run(TWO_MASSES, strange)


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
    np.testing.assert_allclose(coupled_free_run(early, record).y[1:], y[1:], rtol=1e-14)


def test_a_short_warm_up_and_a_bad_interval_are_refused() -> None:
    record = make_coupled_record(TWO_MASSES)
    with pytest.raises(SettingsError, match="reads 2 samples back"):
        coupled_free_run(TWO_MASSES, record, warm_up=1)
    with pytest.raises(SettingsError, match="at least 1 sample"):
        CoupledSimulator(TWO_MASSES, record, 0)
