"""Predictors: divergence is an outcome with its sample, invalid arguments raise errors."""

import math
import re

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.simulation.outcome import OK, Status
from islands.simulation.predictors import (
    BOUND,
    divergence_bound,
    free_run,
    free_run_error,
    multiple_shooting,
    one_step_ahead,
)

SAMPLES = 300


def model(*terms):
    return make_model([(parse(text), parameter) for parameter, text in terms])


def record(u=None, segments=()):
    generator = np.random.default_rng(11)
    drawn = generator.normal(size=(2, SAMPLES))
    return Dataset(drawn[0] if u is None else u, drawn[1], 0.1, segments=segments)


def spikes(**at):
    """Return an input of small numbers with spikes; ``s100=1e9`` is a spike at sample 100."""
    u = np.random.default_rng(12).normal(size=SAMPLES)
    for name, size in at.items():
        u[int(name[1:])] = size
    return u


def simulate_scalar(chosen, data, interval=None, bound=None):
    """Simulate with Python floats.

    Return the predictions up to each divergence, and the first diverged sample.
    """
    bound = divergence_bound(data.y) if bound is None else bound
    u, y, found = data.u[:, 0].tolist(), data.y.tolist(), np.full(data.samples, np.nan)
    first = None
    for begin, end in data.bounds:
        for start in range(begin + chosen.maximum_lag, end, interval or data.samples):
            past = y[:start]
            for k in range(start, min(start + (interval or data.samples), end)):
                channels = (past, u)
                total = 0.0
                for weight, item in zip(chosen.theta, chosen.regressors, strict=True):
                    total += weight * value(item.expression, lambda c, lag, k=k, s=channels: s[c][k - lag])
                if not abs(total) <= bound:
                    first = k if first is None else first
                    break
                past.append(total)
                found[k] = total
    return found, first


#: Models and inputs that leave the bound in different ways, and the first sample at which a free run does
#: (None if only the scalar simulation gives it).
DIVERGENCES = {
    "growing slowly": (model((1.2, "y(k-1)"), (1.0, "u(k-1)")), {}, None),
    "growing at once": (model((0.5, "y(k-1)^4*y(k-2)^2"), (9.0, "u(k-1)")), {}, None),
    "swinging": (model((-1.5, "y(k-1)"), (1.0, "u(k-1)")), {}, None),
    "back within the chunk": (model((1.0, "u(k-1)")), {"s100": 1e9}, 101),
    "the first prediction": (model((1.0, "u(k-1)")), {"s0": -1e9}, 1),
    "the last prediction": (model((1.0, "u(k-1)")), {"s298": 1e9}, 299),
    "the last step of a chunk": (model((1.0, "u(k-1)")), {"s64": 1e9}, 65),
    "the first step of a chunk": (model((1.0, "u(k-1)")), {"s65": 1e9}, 66),
    "twice": (model((1.0, "u(k-1)")), {"s210": 1e9, "s90": 1e9}, 91),
    "to infinity and back": (model((1.0, "u(k-1)^2")), {"s50": 1e200}, 51),
    "to NaN and back": (model((1.0, "u(k-1)^2"), (1.0, "u(k-1)^3")), {"s77": -1e200}, 78),
    "to NaN for good": (model((math.nan, "y(k-1)"), (1.0, "u(k-1)")), {}, 1),
}

every_divergence = pytest.mark.parametrize("name", DIVERGENCES)


@every_divergence
@pytest.mark.parametrize("interval", [1, 10, 70, None])
def test_divergence_outcome_names_the_first_sample(name, interval):
    chosen, at, _ = DIVERGENCES[name]
    data = record(spikes(**at))
    expected, first = simulate_scalar(chosen, data, interval)
    found = multiple_shooting(chosen, data, interval)
    # Predictions are NaN from the sample at which they leave the bound to the end of the interval.
    assert np.array_equal(found.y, expected, equal_nan=True)
    if first is None:
        assert found.outcome == OK
        assert math.isfinite(found.mean_squared_error)
    else:
        assert found.outcome.verdict is Status.DIVERGED
        assert found.outcome.reason == f"|y| left {divergence_bound(data.y):.3g} at sample {first}"
        assert found.mean_squared_error == math.inf


@every_divergence
def test_diverging_free_run_is_nan_from_the_diverged_sample(name):
    chosen, at, known_sample = DIVERGENCES[name]
    data = record(spikes(**at))
    found = free_run(chosen, data)
    sample = int(re.fullmatch(r"\|y\| left \S+ at sample (\d+)", found.outcome.reason)[1])
    assert known_sample in (None, sample)
    assert np.isfinite(found.y[chosen.maximum_lag : sample]).all()
    assert np.isnan(found.y[sample:]).all()


def test_divergence_only_ends_its_own_interval():
    data = record(spikes(s100=1e9), segments=(90, 60, 150))
    found = multiple_shooting(model((1.0, "u(k-1)")), data, 20).y
    # Intervals of the second segment begin at 91 and 111.
    assert np.isnan(found[101:111]).all()
    predicted = np.r_[1:90, 91:101, 111:150, 151:300]
    assert np.array_equal(found[predicted], data.u[predicted - 1, 0])


@pytest.mark.parametrize(
    ("y", "scale"),
    [
        ([-3.0, 5.0, 1.0], 8.0),
        ([100.0, 101.0, 100.5], 101.0),
        ([-1e-6, 1e-6, 0.0], 2e-6),
        ([-7.0, -7.0, -7.0], 7.0),
        ([0.0, 0.0, 0.0], 1.0),
        ([0.0, math.nan, math.nan], 1.0),
        ([1e-6, math.nan, 2e-6], 1.0),
        ([40.0, math.nan, -20.0], 60.0),
        ([math.nan, math.nan, math.nan], 1.0),
    ],
)
def test_bound_is_a_million_times_the_known_scale_of_the_output(y, scale):
    assert divergence_bound(np.array(y)) == pytest.approx(BOUND * scale)
    assert BOUND == 1e6


def test_output_known_only_as_zero_does_not_give_a_zero_bound():
    # Only the initial zero of the output is known, which must not give a scale of zero.
    y = np.full(SAMPLES, np.nan)
    y[0] = 0.0
    found = free_run(model((0.5, "y(k-1)"), (1.0, "u(k-1)")), Dataset(np.ones(SAMPLES), y, 0.1))
    assert found.outcome
    assert found.y[-1] == pytest.approx(2.0)


# Invalid arguments.


@pytest.mark.parametrize("warm_up", [0, 3, -1])
def test_warm_up_shorter_than_the_largest_lag_is_refused(warm_up):
    chosen = model((1.0, "u(k-1)"), (0.1, "y(k-4)"))
    with pytest.raises(SettingsError) as caught:
        one_step_ahead(chosen, record(), warm_up)
    assert str(caught.value) == f"the model reads 4 samples back, the warm-up has {warm_up}"
    assert one_step_ahead(chosen, record(), 4).outcome


def test_a_free_run_with_an_allowed_error_has_the_same_error_or_an_infinite_one():
    chosen, data = model((0.6, "y(k-1)"), (0.3, "u(k-1)")), record(segments=(100, 200))
    error = free_run(chosen, data, 3).mean_squared_error
    parts = chosen.regressors, chosen.parameters, data, 3
    assert free_run_error(*parts) == free_run_error(*parts, error) == error
    assert free_run_error(*parts, 0.99 * error) == math.inf
    assert free_run_error(model((1.9, "y(k-1)")).regressors, (1.9,), data, 3) == math.inf
