"""Contract of the simulation kernel: a plain recursion on every lane, at every width of a row."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.kernels.simulate import ABANDONED, CHUNK, COMPLETE, DIVERGED, WIDTHS, simulate
from islands.kernels.summation import total
from islands.models.narx import make_model
from islands.program.term_pool import link
from islands.records.dataset import Dataset
from islands.simulation.layout import layout

SAMPLES = 3 * CHUNK + 12

#: Segments of several chunks, shorter than a warm-up, and of a few samples: lanes end at different times.
SEGMENTS = (SAMPLES, 2, 70, 9, CHUNK + 3, 30)


def run_on(model, cut, samples, bound=1e6, patient=True, allowed=math.inf):
    """Return status, squared error, step of divergence and prediction, all preset with other values."""
    squared_error = np.full(len(cut.start), 12345.0)
    diverged = np.full(len(cut.start), 12345)
    predicted = np.full(samples, np.nan)
    theta, program = np.array(model.parameters), link(model.regressors)
    status = simulate(program, theta, cut, bound, allowed, patient, squared_error, diverged, predicted)
    return status, squared_error, diverged, predicted


def run(model, record, interval, bound=1e6, patient=True, wanted=True):
    """Return the layout, squared error, step of divergence and prediction."""
    cut = layout(record, model.maximum_lag, interval)
    _, *found = run_on(model, cut, record.samples if wanted else 0, bound, patient)
    return cut, *found


def echo():
    """Return a model that predicts the previous input, so that a test chooses the predictions by u."""
    return make_model([(parse("u(k-1)"), 1.0)])


def record(u=None, y=None, segments=(SAMPLES,), seed=5):
    generator = np.random.default_rng(seed)
    drawn = generator.normal(size=(2, sum(segments)))
    return Dataset(drawn[0] if u is None else u, drawn[1] if y is None else y, 1.0, segments=segments)


def recursion(model, data, start, length, bound):
    """Simulate one interval in plain floats: squared error, step of divergence and predictions."""
    channels = [data.y[: int(start)].tolist(), *data.u.T.tolist()]
    squares, diverged = 0.0, -1
    for step in range(int(length)):
        k, prediction = int(start) + step, 0.0
        for weight, item in zip(model.theta, model.regressors, strict=True):
            prediction += weight * value(
                item.expression, lambda channel, lag, k=k: channels[channel][k - lag]
            )
        channels[0].append(prediction)
        squares += (prediction - float(data.y[k])) * (prediction - float(data.y[k]))
        if diverged < 0 and not abs(prediction) <= bound:
            diverged = step
    return squares, diverged, channels[0][int(start) :]


@pytest.fixture(params=WIDTHS)
def width(request, monkeypatch):
    """Return every row width of the kernel in turn, instead of the one that the layout chooses."""
    monkeypatch.setattr("islands.simulation.layout.WIDTHS", (request.param,))
    return request.param


@pytest.fixture
def damped():
    return make_model([(parse("y(k-2)"), 0.5), (parse("u(k-1)*y(k-1)"), 0.1), (parse("u(k-3)"), 1.0)])


@pytest.mark.parametrize("interval", [1, 2, 7, CHUNK, CHUNK + 1, None])
def test_every_lane_equals_a_recursion_in_plain_floats_at_every_width(damped, interval, width):
    data = record(segments=SEGMENTS)
    cut, squared_error, diverged, predicted = run(damped, data, interval)
    assert cut.width == width
    lanes = list(zip(cut.start, cut.length, strict=True))
    for lane, (start, length) in enumerate(lanes):
        squares, step, expected = recursion(damped, data, start, length, 1e6)
        assert (squared_error[lane], diverged[lane]) == (squares, step)
        assert predicted[start : start + length].tolist() == expected
    assert np.isfinite(predicted).sum() == cut.length.sum()


@pytest.mark.parametrize("interval", [1, 2, 7, CHUNK, None])
@pytest.mark.parametrize("bound", [1.0, 2.5])
def test_every_lane_diverges_at_the_step_of_the_recursion(damped, interval, bound, width):
    data = record(segments=SEGMENTS)
    cut, squared_error, diverged, _ = run(damped, data, interval, bound)
    found = 0
    for lane, (start, length) in enumerate(zip(cut.start, cut.length, strict=True)):
        squares, step, _ = recursion(damped, data, start, length, bound)
        assert (squared_error[lane], diverged[lane]) == (squares, step)
        found += step >= 0
    assert found > 0


@pytest.mark.parametrize("interval", [2, 7, CHUNK + 1, None])
@pytest.mark.parametrize("poison", [math.nan, 1e300])
def test_padding_lanes_do_not_affect_the_results(damped, interval, poison, width):
    data = record(segments=SEGMENTS)
    cut = layout(data, damped.maximum_lag, interval)
    signals = cut.signals.copy()
    base = poisoned = 0
    for offset, lanes in zip(cut.block_offset, cut.block_lanes, strict=True):
        rows = cut.warm_up + cut.length[base]
        block = signals[:, offset : offset + rows * width].reshape(len(signals), rows, width)
        block[:, :, lanes:] = poison  # after the block's last lane
        for lane in range(lanes):
            block[:, cut.warm_up + cut.length[base + lane] :, lane] = poison  # after the end of a lane
        poisoned += np.count_nonzero(~(np.abs(block) < 1e299))
        base += lanes
    assert poisoned > 0
    for patient in (True, False):
        expected = run_on(damped, cut, data.samples, patient=patient)
        found = run_on(damped, cut._replace(signals=signals), data.samples, patient=patient)
        assert expected[0] == found[0] == COMPLETE
        for left, right in zip(expected[1:], found[1:], strict=True):
            assert np.array_equal(left, right, equal_nan=True)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_prediction_outside_the_bound_is_found_despite_a_small_error(sign, width):
    u, y = np.zeros(SAMPLES), np.zeros(SAMPLES)
    u[5] = sign * np.nextafter(8.0, 9.0)
    assert run(echo(), record(u=u, y=y), None, bound=8.0)[2].tolist() == [5]
    y[6] = sign * 7.0  # close to the prediction
    assert run(echo(), record(u=u, y=y), None, bound=8.0)[2].tolist() == [5]


# Status of a simulation.


@pytest.mark.parametrize("patient", [True, False])
@pytest.mark.parametrize("step", [-1, 0, CHUNK, SAMPLES - 2])
def test_status_reports_a_divergence(patient, step, width):
    u = np.zeros(SAMPLES)
    if step >= 0:
        u[step] = 9.0
    cut = layout(record(u=u), 1, None)
    assert run_on(echo(), cut, 0, bound=8.0, patient=patient)[0] == (COMPLETE if step < 0 else DIVERGED)


@given(
    st.sampled_from([1, 2, 7, CHUNK, 100, None]),
    st.floats(0.0, 2.0) | st.sampled_from([1.0, 1 - 1e-12, 1 + 1e-12, 1 - 1e-8, math.inf]),
    st.sampled_from(WIDTHS),
    st.integers(0, 2**32 - 1),
)
def test_allowed_error_stops_only_larger_errors(interval, share, chosen, seed):
    model = make_model([(parse("y(k-2)"), 0.5), (parse("u(k-1)*y(k-1)"), 0.1), (parse("u(k-3)"), 1.0)])
    data = record(segments=SEGMENTS, seed=seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("islands.simulation.layout.WIDTHS", (chosen,))
        cut = layout(data, model.maximum_lag, interval)
    whole, *expected = run_on(model, cut, data.samples)
    error = total(expected[0])
    allowed = share * error
    for patient in (True, False):
        status, *found = run_on(model, cut, data.samples, patient=patient, allowed=allowed)
        if status == ABANDONED:
            assert error > allowed
        else:
            assert status == whole == COMPLETE
            assert error <= allowed * (1 + 2e-9)
            for left, right in zip(expected, found, strict=True):
                assert np.array_equal(left, right, equal_nan=True)


def test_simulation_stops_after_the_chunk_that_exceeds_the_limit(width):
    """There are no predictions after the first chunk."""
    y, u = np.zeros(SAMPLES), np.zeros(SAMPLES)
    u[3] = 100.0
    data = record(u=u, y=y)
    cut = layout(data, 1, None)
    status, _, _, predicted = run_on(echo(), cut, SAMPLES, allowed=9999.0)
    assert status == ABANDONED
    assert np.isfinite(predicted[1 : CHUNK + 1]).all()
    assert np.isnan(predicted[CHUNK + 1 :]).all()
    assert run_on(echo(), cut, SAMPLES, allowed=10000.0)[0] == COMPLETE


@pytest.mark.parametrize(("bound", "prediction"), [(1e200, 1e250), (1e-170, 1e-168), (1e-160, -1e-159)])
def test_bound_without_a_finite_nonzero_square_is_respected(bound, prediction, width):
    u, y = np.zeros(SAMPLES), np.zeros(SAMPLES)
    u[10] = prediction
    assert run(echo(), record(u=u, y=y), None, bound=bound)[2].tolist() == [10]
