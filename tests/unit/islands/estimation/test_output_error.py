"""Linear models of the free run: poles that least squares does not find, and their standard errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.estimate import estimate
from islands.estimation.output_error import fit_output_error
from islands.estimation.refinement import refine
from islands.records.dataset import Dataset, join
from islands.records.input_lead import advance_inputs
from support.slow_processes import BATTERY_NOISE, BATTERY_POLE, TANK_NOISE, make_battery, make_tank


def poles(model):
    lags = dict(zip(model.parameter_names, model.theta, strict=True))
    count = max(lag for lag in range(1, 5) if f"y(k-{lag})" in lags)
    return np.sort(np.roots([1.0, *(-lags[f"y(k-{lag})"] for lag in range(1, count + 1))]))


def make_record(seed, numerator, denominator, noise, samples=600, offset=0.0, rest=0):
    random = np.random.default_rng(seed)
    u = np.repeat(random.uniform(-1.0, 1.0, samples // 5), 5)
    u[:rest] *= 1e-3
    y = offset + lfilter([0.0, *numerator], denominator, u)
    return Dataset(u, y + noise * random.standard_normal(samples), 0.1)


def make_coloured_record(seed, samples=600):
    """Return a resonance with noise whose resonance is near that of the system."""
    record = make_record(seed, [0.1, 0.15], [1.0, -1.5, 0.7], 0.0, samples)
    noise = lfilter(
        [1.0], [1.0, -1.7, 0.9], np.random.default_rng(seed + 1000).standard_normal(samples + 200)
    )
    return replace(record, y=record.y + 0.05 * noise[200:])


def fit_pair(record):
    """Return the models of second order: that of the output error, and that of the whitened error."""
    return [each for each in fit_output_error(record) if each.model.output_lag == 2]


def test_poles_of_a_battery_are_found_where_least_squares_fails():
    record = advance_inputs(make_battery(3, 2000), [0])
    best = fit_output_error(record)[0]
    assert best.model.parameter_names == ("y(k-1)", "y(k-2)", "u1(k-1)", "u1(k-2)", "u1(k-3)")
    assert poles(best.model) == pytest.approx([BATTERY_POLE, 1.0], abs=2e-3)
    assert best.residual_variance**0.5 == pytest.approx(BATTERY_NOISE, rel=0.1)
    assert poles(estimate(best.model.regressors, record).model)[0] < 0.7


def test_law_of_a_noise_free_record_is_exact():
    record = make_record(1, [0.1, 0.15], [1.0, -1.5, 0.7], 0.0)
    found = {each.model.size: each.model for each in fit_output_error(record)}
    assert found[4].theta == pytest.approx((1.5, -0.7, 0.1, 0.15), abs=1e-9)


def test_model_has_a_constant_only_if_the_output_has_an_offset():
    denominator = [1.0, -0.9]
    for offset, names in ((0.0, ("y(k-1)", "u1(k-1)")), (3.0, ("1", "y(k-1)", "u1(k-1)"))):
        found = fit_output_error(make_record(2, [0.3], denominator, 0.05, offset=offset))[0].model
        assert set(found.parameter_names) == set(names)
        assert dict(zip(found.parameter_names, found.theta, strict=True))["y(k-1)"] == pytest.approx(
            0.9, abs=0.01
        )


def test_initial_states_differ_between_segments():
    parts = [make_tank(seed, 120) for seed in range(4)]
    record = join(tuple(replace(part, y=part.y + 5.0 * place) for place, part in enumerate(parts)))
    found = fit_output_error(record)[0]
    assert found.model.theta == pytest.approx((1.0, 0.02), abs=3e-4)
    assert found.residual_variance**0.5 == pytest.approx(TANK_NOISE, rel=0.15)


def test_models_far_from_zero_do_not_depend_on_the_zero():
    record = make_record(2, [0.3], [1.0, -0.9], 0.05)
    fits = [
        # In the first units, the law of gain 3 needs no constant.
        fit_output_error(replace(record, y=record.y + y, u=record.u + u))
        for y, u in ((3000.0, 1000.0), (-2000.0, 500.0))
    ]
    assert [each.model.parameter_names for each in fits[0]] == [
        each.model.parameter_names for each in fits[1]
    ]
    for one, other in zip(*fits, strict=True):
        assert one.residual_variance == pytest.approx(other.residual_variance, rel=1e-6)
        assert "1" in one.model.parameter_names


def test_dead_times_shift_the_lags_of_their_inputs():
    random = np.random.default_rng(4)
    u = np.repeat(random.uniform(-1.0, 1.0, (200, 2)), 4, axis=0)
    y = lfilter([0.0, 0.3], [1.0, -0.8], np.append(np.zeros(3), u[:-3, 0]) - 0.5 * u[:, 1])
    record = Dataset(u, y + 0.01 * random.standard_normal(800), 1.0, ("a", "b"))
    found = fit_output_error(record, (3, 0))[0].model
    assert found.parameter_names == ("y(k-1)", "u1(k-4)", "u2(k-1)")
    assert found.theta == pytest.approx((0.8, 0.3, -0.15), abs=0.01)


def test_estimate_is_the_minimum_of_the_refinement_of_the_free_run():
    record = make_record(5, [0.2, 0.1], [1.0, -1.6, 0.8], 0.02, 300)
    found = next(each.model for each in fit_output_error(record) if each.model.size == 4)
    refined = refine(found.with_parameters([1.01 * each for each in found.theta]), record, None).model
    # The refinement weights the first outputs differently: it takes them as measurements.
    assert refined.theta == pytest.approx(found.theta, rel=3e-3)
    assert refined.standard_errors == pytest.approx(found.standard_errors, rel=0.2)


@pytest.mark.ci
@pytest.mark.parametrize("rest", [0, 6000])
def test_estimate_of_a_long_record_is_its_minimum(rest):
    record = make_record(5, [0.2, 0.1], [1.0, -1.6, 0.8], 0.2, 12_000, rest=rest)
    found = next(each.model for each in fit_output_error(record) if each.model.size == 4)
    refined = refine(found, record, None).model
    shift = np.abs(np.subtract(refined.theta, found.theta)) / found.standard_errors
    assert shift.max() < 0.05
    assert found.theta == pytest.approx((1.6, -0.8, 0.2, 0.1), abs=0.01)


@pytest.mark.ci
def test_constant_that_only_many_samples_show_is_found():
    record = make_tank(3, 12_000, 0.5)
    drift = replace(record, y=record.y + 1e-4 * np.arange(12_000))
    sizes = [fit_output_error(each)[0].model.size for each in (record, drift[:4000], drift)]
    assert sizes == [2, 2, 3]


@pytest.mark.ci
def test_intervals_contain_the_true_parameters():
    true, inside = (1.5, -0.7, 0.1, 0.15), []
    for seed in range(60):
        found = fit_output_error(make_record(seed, true[2:], [1.0, -1.5, 0.7], 0.05))
        model = next(each.model for each in found if each.model.size == 4)
        inside.append(np.abs(np.subtract(model.theta, true)) <= 1.96 * np.array(model.standard_errors))
    # Of 240 intervals with a probability of 0.95.
    assert 0.9 < np.mean(inside) < 0.99


@pytest.mark.ci
def test_whitened_error_of_coloured_noise_has_the_smaller_variance():
    true = np.array([1.5, -0.7, 0.1, 0.15])
    pairs = [pair for pair in (fit_pair(make_coloured_record(seed)) for seed in range(30)) if len(pair) == 2]
    assert len(pairs) > 25
    errors = np.array([[np.array(each.model.theta[:4]) - true for each in pair] for pair in pairs])
    first, second = np.sqrt(np.mean(errors**2, axis=0))
    assert (second < 0.8 * first).all()


@pytest.mark.ci
def test_intervals_of_the_whitened_error_contain_the_true_parameters():
    true, inside = (1.5, -0.7, 0.1, 0.15), []
    for seed in range(60):
        pair = fit_pair(make_coloured_record(seed))
        if len(pair) == 2:
            error = np.subtract(pair[1].model.theta[:4], true)
            inside.append(np.abs(error) <= 1.96 * np.array(pair[1].model.standard_errors[:4]))
    assert len(inside) > 50
    # Of more than 200 intervals with a probability of 0.95.
    assert 0.9 < np.mean(inside) < 0.99


def test_record_that_is_too_short_has_no_model():
    assert fit_output_error(make_tank(0, 10)) == []


def test_same_record_gives_the_same_bits():
    record = make_tank(7, 300)
    first, second = (fit_output_error(replace(record)) for _ in range(2))
    assert [each.model for each in first] == [each.model for each in second]
