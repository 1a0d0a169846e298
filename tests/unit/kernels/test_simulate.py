"""The simulation kernel's own contract: its outputs a lane, its bound, its impatience."""

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.kernels.simulate import CHUNK, simulate
from islands.model.model import model_of
from islands.model.parsing import parse
from islands.program.linker import link
from islands.simulation.layout import layout

SAMPLES = 3 * CHUNK + 12


def run(model, record, interval, bound=1e6, patient=True, wanted=True):
    """Return squared error, step of divergence and prediction, on outputs full of rubbish before."""
    cut = layout(record, model.maximum_lag, interval)
    squared_error = np.full(len(cut.start), 12345.0)
    diverged = np.full(len(cut.start), 12345)
    predicted = np.full(record.samples if wanted else 0, np.nan)
    theta = np.array(model.parameters)
    simulate(link(model.regressors), theta, cut, bound, patient, squared_error, diverged, predicted)
    return cut, squared_error, diverged, predicted


def echo():
    """A model that predicts the input one sample back, so that a test writes its predictions into u."""
    return model_of([(parse("u(k-1)"), 1.0)])


def record(u=None, y=None):
    generator = np.random.default_rng(5)
    drawn = generator.normal(size=(2, SAMPLES))
    return Dataset(drawn[0] if u is None else u, drawn[1] if y is None else y, 1.0)


@pytest.fixture
def damped():
    return model_of([(parse("y(k-2)"), 0.5), (parse("u(k-1)*y(k-1)"), 0.1), (parse("u(k-3)"), 1.0)])


@pytest.mark.parametrize("interval", [1, 7, CHUNK, CHUNK + 1, None])
def test_a_lanes_squared_error_is_summed_in_the_order_of_time(damped, interval):
    data = record()
    cut, squared_error, diverged, predicted = run(damped, data, interval)
    assert (diverged == -1).all()
    for start, length, found in zip(cut.start, cut.length, squared_error, strict=True):
        expected = 0.0
        for error in (predicted[start : start + length] - data.y[start : start + length]).tolist():
            expected += error * error
        assert found == expected


@pytest.mark.parametrize("interval", [1, 7, None])
def test_not_asking_for_predictions_changes_no_other_output(damped, interval):
    _, squared_error, diverged, _ = run(damped, record(), interval)
    _, alone, without, nothing = run(damped, record(), interval, wanted=False)
    assert np.array_equal(squared_error, alone)
    assert np.array_equal(diverged, without)
    assert nothing.size == 0


@pytest.mark.parametrize(("prediction", "step"), [(8.0, -1), (-8.0, -1), (np.nextafter(8.0, 9.0), 0)])
def test_the_bound_itself_is_still_inside(prediction, step):
    u = np.zeros(SAMPLES)
    u[0] = prediction
    assert run(echo(), record(u=u), None, bound=8.0)[2].tolist() == [step]


@pytest.mark.parametrize("step", [0, 1, CHUNK - 1, CHUNK, 2 * CHUNK + 3, SAMPLES - 2])
def test_a_single_sample_outside_the_bound_is_found_wherever_it_stands(step):
    u = np.zeros(SAMPLES)
    u[step] = 9.0
    _, _, diverged, predicted = run(echo(), record(u=u), None, bound=8.0)
    assert diverged.tolist() == [step]
    # The kernel hands out all that it computed; to judge it is its caller's.
    assert np.array_equal(predicted[1:], u[:-1])


def test_the_first_of_several_samples_outside_is_reported():
    u = np.zeros(SAMPLES)
    u[[20, 30, CHUNK + 5]] = 9.0
    assert run(echo(), record(u=u), None, bound=8.0)[2].tolist() == [20]


def test_every_lane_reports_its_own_step():
    u = np.zeros(SAMPLES)
    u[[5, 27, 28]] = 9.0
    cut, _, diverged, _ = run(echo(), record(u=u), 10, bound=8.0)
    found = {int(start): int(step) for start, step in zip(cut.start, diverged, strict=True) if step >= 0}
    assert found == {1: 5, 21: 7}


def test_an_impatient_run_stops_at_the_end_of_the_chunk_in_which_a_lane_diverged():
    u = np.zeros(SAMPLES)
    u[CHUNK + 1] = u[2 * CHUNK + 1] = 9.0
    _, _, diverged, predicted = run(echo(), record(u=u), None, bound=8.0, patient=False)
    assert diverged.tolist() == [CHUNK + 1]
    assert np.isfinite(predicted[1 : CHUNK + 1]).all()
    assert np.isnan(predicted[2 * CHUNK + 1 :]).all()


@pytest.mark.parametrize("interval", [1, 7, None])
def test_impatience_changes_nothing_where_nothing_diverges(damped, interval):
    patient, hasty = (run(damped, record(), interval, patient=patient)[1:] for patient in (True, False))
    for left, right in zip(patient, hasty, strict=True):
        assert np.array_equal(left, right, equal_nan=True)
