"""Properties of simulation: one-step-ahead prediction, multiple shooting and free run.

The test oracle is the definition: a recursion over samples in plain floats, with
`islands.expressions.tree.value`. The kernel must agree with it to the last bit.
"""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import RecordError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.kernels.summation import total
from islands.models.narx import make_model
from islands.records.dataset import Dataset, join
from islands.simulation.linked import LinkedModel
from islands.simulation.predictors import free_run, multiple_shooting, one_step_ahead


def model(inputs=1, **terms):
    """Make a model of ``name="parameter * text"`` terms; the names only distinguish them."""
    split = (term.split(" * ", 1) for term in terms.values())
    names = ("u",) if inputs == 1 else tuple(f"u{index + 1}" for index in range(inputs))
    return make_model([(parse(text), float(parameter)) for parameter, text in split], names)


#: Stable models of every kind that the kernel treats separately.
MODELS = {
    "linear": model(a="1.2 * y(k-1)", b="-0.5 * y(k-2)", c="0.3 * u(k-1)"),
    "deepest lag on y": model(a="0.4 * y(k-9)", b="0.3 * y(k-1)", c="1 * u(k-2)"),
    "deepest lag on u": model(a="0.6 * y(k-1)", b="1 * u(k-11)", c="-0.4 * u(k-1)"),
    "input alone": model(a="0.6 * u(k-1)", b="1 * u(k-3)*u(k-1)", c="0.2 * 1"),
    "output alone": model(a="0.9 * y(k-1)", b="-0.1 * y(k-3)"),
    "a single term": model(a="0.7 * y(k-1)"),
    "hysteresis": model(
        a="1 * y(k-1)",
        b="0.77 * phi1(u(k-1), u(k-2))",
        c="0.0144 * u(k-2)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))",
        d="-0.096 * y(k-1)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))",
        e="0.00315 * u(k-2)^2*phi1(u(k-2), u(k-3))",
        f="-0.0246 * u(k-2)*y(k-1)*phi1(u(k-2), u(k-3))",
    ),
    "one to seven factors": model(
        a="0.1 * y(k-1)",
        b="0.02 * u(k-1)*u(k-2)",
        c="0.02 * u(k-1)^2*u(k-2)",
        d="0.01 * u(k-1)^2*u(k-2)*u(k-4)",
        e="0.01 * u(k-1)^2*u(k-2)^2*u(k-4)",
        f="0.001 * u(k-1)^3*u(k-2)^3*sign(y(k-1))",
    ),
    "shared subexpressions": model(
        a="0.3 * abs(y(k-1) - u(k-2))",
        b="0.2 * abs(y(k-1) - u(k-2))*sign(u(k-1) - y(k-1))",
        c="0.1 * sqrt(abs(y(k-1) - u(k-2)) + u(k-1)^2)",
        d="0.1 * max(sqrt(y(k-2)), u(k-1)) + min(y(k-1), 0.5)",
    ),
    "rational": model(
        a="1 * y(k-1)*(2.5 + y(k-1))/(4 + y(k-1)^2 + y(k-2)^2)", b="0.5 * u(k-1)/(1 + abs(u(k-2)))"
    ),
    "two inputs": model(2, a="0.5 * y(k-1)", b="1 * u1(k-2)*u2(k-5)", c="-0.3 * u2(k-1)", d="0.1 * u1(k-1)"),
}

#: Segments of several chunks (64 steps), as long as a warm-up, shorter, and of a single sample.
SEGMENTS = (150, 3, 70, 12, 1, 64, 30)

every_model = pytest.mark.parametrize("name", MODELS)


def record(model, segments=SEGMENTS, seed=0):
    """Draw a record of noise."""
    generator = np.random.default_rng(seed)
    samples = sum(segments)
    u, y = generator.normal(size=(samples, model.inputs)), generator.normal(size=samples)
    return Dataset(u, y, 0.1, segments=segments)


def recursion(model, record, interval=None, warm_up=None):
    """Simulate sample by sample by definition; ``interval=None`` is the free run."""
    warm_up = model.maximum_lag if warm_up is None else warm_up
    u, measured, found = record.u.tolist(), record.y.tolist(), [float("nan")] * record.samples
    terms = [(weight, item.expression) for weight, item in zip(model.theta, model.regressors, strict=True)]
    for begin, end in record.bounds:
        for start in range(begin + warm_up, end, interval or record.samples):
            for k in range(start, min(start + (interval or record.samples), end)):

                def signal(channel, lag, k=k, start=start):
                    if channel:
                        return u[k - lag][channel - 1]
                    return found[k - lag] if k - lag >= start else measured[k - lag]

                prediction = 0.0
                for weight, expression in terms:
                    prediction += weight * value(expression, signal)
                found[k] = prediction
    return np.array(found)


def equal_bits(left, right):
    """Return whether two predictions are equal bit for bit, including missing values."""
    return left.tobytes() == right.tobytes()


def draw_records(data):
    """Draw a model, segments of which at least one is long enough, and a warm-up."""
    name = data.draw(st.sampled_from(list(MODELS)))
    warm_up = MODELS[name].maximum_lag + data.draw(st.integers(0, 8))
    lengths = data.draw(st.lists(st.integers(1, 90), min_size=1, max_size=5))
    lengths[data.draw(st.integers(0, len(lengths) - 1))] += warm_up
    seed = data.draw(st.integers(0, 2**32 - 1))
    return MODELS[name], record(MODELS[name], tuple(lengths), seed), warm_up


# Kernel and definition.


@pytest.mark.ci
@every_model
@pytest.mark.parametrize("interval", [1, 2, 3, 7, 63, 64, 65, 140, None])
def test_kernel_equals_the_recursion_bit_for_bit(name, interval):
    data = record(MODELS[name])
    found = multiple_shooting(MODELS[name], data, interval)
    assert found.outcome
    assert equal_bits(found.y, recursion(MODELS[name], data, interval))


@pytest.mark.ci
@given(st.data())
def test_kernel_equals_the_recursion_for_random_layouts(data):
    chosen, drawn, warm_up = draw_records(data)
    interval = data.draw(st.none() | st.integers(1, 100))
    found = multiple_shooting(chosen, drawn, interval, warm_up)
    assert found.outcome
    assert equal_bits(found.y, recursion(chosen, drawn, interval, warm_up))


def test_functions_of_the_mathematical_library_agree_to_rounding():
    chosen = model(
        a="0.5 * tanh(y(k-1) + u(k-1))",
        b="0.3 * sin(y(k-2))*cos(u(k-2))",
        c="0.1 * exp(0 - abs(y(k-1)))",
        d="0.05 * log(u(k-3))",
    )
    data = record(chosen)
    for interval in (1, 20, None):
        found, expected = multiple_shooting(chosen, data, interval).y, recursion(chosen, data, interval)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)


# One-step-ahead prediction and free run as special cases.


@every_model
def test_intervals_of_one_sample_are_one_step_ahead_predictions(name):
    chosen, data = MODELS[name], record(MODELS[name])
    found, other = one_step_ahead(chosen, data), multiple_shooting(chosen, data, 1)
    assert equal_bits(found.y, other.y)
    assert found.mean_squared_error == other.mean_squared_error
    # Its definition needs no recursion.
    channels = [data.y.tolist(), *data.u.T.tolist()]
    for begin, end in data.bounds:
        for k in range(begin + chosen.maximum_lag, end):
            terms = [
                weight * value(item.expression, lambda channel, lag, k=k: channels[channel][k - lag])
                for weight, item in zip(chosen.theta, chosen.regressors, strict=True)
            ]
            assert found.y[k] == sum(terms, 0.0)


# Predicted samples.


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("interval", [1, 20, None])
def test_squared_errors_are_summed_from_the_longest_interval_on(seed, interval):
    chosen, data = MODELS["linear"], record(MODELS["linear"], seed=seed)
    found = multiple_shooting(chosen, data, interval)
    intervals = [
        slice(start, min(start + (interval or data.samples), end))
        for begin, end in data.bounds
        for start in range(begin + 2, end, interval or data.samples)
    ]
    intervals.sort(key=lambda interval_: interval_.start - interval_.stop)
    sums = [
        sum((error * error for error in (found.y - data.y)[interval_].tolist()), 0.0)
        for interval_ in intervals
    ]
    assert found.mean_squared_error == total(np.array(sums)) / np.isfinite(found.y).sum()


# Causality and boundaries.


@given(st.data())
def test_present_and_future_samples_do_not_affect_predictions(data):
    chosen, drawn, warm_up = draw_records(data)
    interval = data.draw(st.none() | st.integers(1, 40))
    k = data.draw(st.integers(0, drawn.samples - 1))
    other = record(chosen, drawn.segments, seed=99)
    u, y = drawn.u.copy(), drawn.y.copy()
    u[k:], y[k:] = other.u[k:], other.y[k:]
    before = multiple_shooting(chosen, drawn, interval, warm_up).y
    after = multiple_shooting(chosen, replace(drawn, u=u, y=y), interval, warm_up).y
    assert equal_bits(before[: k + 1], after[: k + 1])


@given(st.data())
def test_free_run_does_not_use_outputs_after_the_warm_up(data):
    chosen, drawn, warm_up = draw_records(data)
    y = drawn.y.copy()
    for begin, end in drawn.bounds:
        y[begin + warm_up : end] = np.nan
    found = free_run(chosen, replace(drawn, y=y), warm_up)
    assert found.outcome
    assert np.isnan(found.mean_squared_error)
    assert equal_bits(found.y, free_run(chosen, drawn, warm_up).y)


@every_model
@pytest.mark.parametrize("interval", [1, 7, None])
def test_joined_recordings_are_predicted_independently(name, interval):
    chosen = MODELS[name]
    recordings = [record(chosen, (length,), seed) for seed, length in enumerate((40, 90, 13, 200))]
    alone = [multiple_shooting(chosen, recording, interval).y for recording in recordings]
    together = multiple_shooting(chosen, join(tuple(recordings)), interval).y
    assert equal_bits(together, np.concatenate(alone))


# Linked models.


def mask_after_warm_up(drawn, warm_up):
    """Return a record whose output is missing after the warm-up."""
    return replace(drawn, y=np.where(np.arange(drawn.samples) < warm_up, drawn.y, np.nan))


@given(st.data())
def test_linked_model_has_the_free_runs_of_the_model(data):
    chosen = MODELS[data.draw(st.sampled_from(list(MODELS)))]
    linked, warm_up = LinkedModel(chosen.regressors), chosen.maximum_lag
    for _ in range(2):
        length = warm_up + data.draw(st.integers(1, 200))
        seeds = data.draw(st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=11))
        drawn = [record(chosen, (length,), seed) for seed in seeds]
        # Large parameters cause divergence.
        factors = [data.draw(st.sampled_from([1.0, -0.3, 0.0, 40.0])) for _ in seeds]
        theta = np.outer(factors, chosen.theta)
        found = linked.free_runs(
            theta, [each.u.T for each in drawn], np.array([each.y[:warm_up] for each in drawn])
        )
        for run, parameters, each in zip(found, theta, drawn, strict=True):
            expected = free_run(chosen.with_parameters(parameters), mask_after_warm_up(each, warm_up)).y
            assert equal_bits(run, expected)


def test_unpickled_linked_model_is_linked_again():
    chosen, data = MODELS["shared subexpressions"], record(MODELS["shared subexpressions"], (90,))
    linked = LinkedModel(chosen.regressors)
    runs = [
        each.free_runs(np.array([chosen.theta]), [data.u.T], data.y[None, :2])
        for each in (linked, pickle.loads(pickle.dumps(linked)))
    ]
    assert equal_bits(*runs)
    # The pickle contains the regressors, but no addresses.
    assert linked.__reduce__() == (LinkedModel, (chosen.regressors,))


def test_linked_model_needs_more_samples_than_its_warm_up():
    linked = LinkedModel(MODELS["deepest lag on u"].regressors)
    with pytest.raises(RecordError, match="the input has 11 samples and the warm-up takes 11"):
        linked.free_runs(np.ones((1, 3)), [np.zeros((1, 11))], np.zeros((1, 11)))


# True model.


@every_model
@pytest.mark.parametrize("interval", [1, 7, 64, None])
def test_true_noise_free_model_reproduces_the_data(name, interval):
    chosen, noise = MODELS[name], record(MODELS[name], seed=3)
    made = recursion(chosen, noise)
    data = replace(noise, y=np.where(np.isnan(made), noise.y, made))
    found = multiple_shooting(chosen, data, interval)
    predicted = ~np.isnan(found.y)
    assert predicted.sum() > 100
    assert np.array_equal(found.y[predicted], data.y[predicted])
    assert found.mean_squared_error == 0.0
