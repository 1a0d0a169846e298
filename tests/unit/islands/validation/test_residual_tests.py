"""Residual tests: every test detects its fault, and a true model is rejected at the nominal rate."""

import math

import numpy as np
import pytest
import scipy

from islands.errors import SettingsError
from islands.validation.residual_tests import FALSE_ALARM, residual_tests

SAMPLES = 2000


def noise_and_input(seed, samples=SAMPLES, inputs=1):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(samples), rng.standard_normal((samples, inputs))


def get_test(result, name, index=0):
    wanted = None if name == "xi_xi" else index
    (found,) = [test for test in result.tests if (test.name, test.input) == (name, wanted)]
    return found


def failed_names(result):
    return {test.name for test in result.tests if not test.passed}


def largest_lag(test):
    return test.lags[np.argmax(np.abs(test.values))]


def delay_by(signal, delay):
    return np.concatenate((np.zeros(delay), signal[:-delay]))


def correlate_pairs(past, present, lag):
    """Compute the definition pair by pair: means removed, normalised by the zero-lag products."""
    past, present = past - past.mean(), present - present.mean()
    pairs = [past[k - lag] * present[k] for k in range(len(past)) if 0 <= k - lag < len(past)]
    return math.fsum(pairs) / math.sqrt(math.fsum(past**2) * math.fsum(present**2))


def test_correlations_match_their_definitions():
    xi, u = noise_and_input(1, samples=60)
    xi, u = xi + 0.3, u + 5.0
    result = residual_tests(xi, u, max_lag=4)
    noise, source = xi - xi.mean(), u[:, 0] - u[:, 0].mean()
    signals = {
        "xi_xi": (noise, noise, 0),
        "u_xi": (source, noise, 0),
        "xi_xiu": (noise * source, noise, 1),
        "u2_xi": (source**2, noise, 0),
        "u2_xi2": (source**2, noise**2, 0),
    }
    for name, (past, present, late) in signals.items():
        test = get_test(result, name)
        expected = [correlate_pairs(past, present, lag + late) for lag in test.lags]
        np.testing.assert_allclose(test.values, expected, rtol=0, atol=1e-12, err_msg=name)


def test_limit_has_the_nominal_level_for_all_lags_of_all_tests():
    xi, u = noise_and_input(4)
    # With one input, five correlation tests and the whiteness test share the level; u_xi has 11 lags.
    test = get_test(residual_tests(xi, u, max_lag=5), "u_xi")
    one_value = scipy.special.chdtr(1, SAMPLES * test.limit**2)
    assert one_value ** (6 * 11) == pytest.approx(1 - FALSE_ALARM)


def test_ljung_box_is_the_weighted_sum_of_squared_autocorrelations():
    xi, u = noise_and_input(5, samples=50)
    result = residual_tests(xi, u, max_lag=6)
    statistic = 50 * 52 * sum(correlate_pairs(xi, xi, lag) ** 2 / (50 - lag) for lag in range(1, 7))
    assert result.ljung_box == pytest.approx(statistic)
    assert result.whiteness_p == pytest.approx(scipy.special.chdtrc(6, statistic))


@pytest.mark.parametrize("kind", ["white", "slow", "sine"])
def test_true_model_is_rejected_at_about_the_nominal_rate(kind):
    rejected, inside = 0, []
    for seed in range(200):
        xi, u = noise_and_input(seed, samples=1000)
        if kind == "slow":
            u = scipy.signal.lfilter([1.0], [1.0, -1.85, 0.855], u, axis=0)
        elif kind == "sine":
            u = np.sin(np.arange(1000) / 16)[:, None]
        result = residual_tests(xi, u)
        rejected += not result.passed
        inside.append(np.mean([test.inside_percent for test in result.tests]))
    # 200 draws at 5 % give 10 rejections with a standard deviation of 3; dependent lags reduce the number.
    assert rejected <= 19
    assert rejected >= (4 if kind == "white" else 1)
    assert np.mean(inside) == pytest.approx(95.0, abs=1.0)


def test_missing_linear_term_appears_in_u_xi_at_its_delay():
    e, u = noise_and_input(6)
    result = residual_tests(e + 0.2 * delay_by(u[:, 0], 3), u)
    assert failed_names(result) == {"u_xi"}
    assert largest_lag(get_test(result, "u_xi")) == 3
    assert get_test(result, "u_xi").values[25 + 3] == pytest.approx(0.2 / math.sqrt(1.04), abs=0.05)
    assert not result.passed


def test_coloured_noise_appears_in_xi_xi_and_whiteness():
    e, u = noise_and_input(7)
    result = residual_tests(scipy.signal.lfilter([1.0], [1.0, -0.3], e), u)
    assert failed_names(result) == {"xi_xi"}
    assert get_test(result, "xi_xi").values[1] == pytest.approx(0.3, abs=0.05)
    assert result.whiteness_p < 1e-6


def test_missing_even_term_appears_in_u2_xi_and_not_in_u_xi():
    e, u = noise_and_input(9)
    result = residual_tests(e + 0.15 * delay_by(u[:, 0] ** 2, 2), u)
    assert failed_names(result) == {"u2_xi"}
    assert largest_lag(get_test(result, "u2_xi")) == 2


def test_units_and_offsets_do_not_change_the_tests():
    e, u = noise_and_input(14, samples=300)
    here, there = residual_tests(e, u), residual_tests(1e-200 * (e + 2.0), 1e160 * (u - 7.0))
    for one, other in zip(here.tests, there.tests, strict=True):
        np.testing.assert_allclose(other.values, one.values, rtol=0, atol=1e-12)
    assert there.whiteness_p == pytest.approx(here.whiteness_p)


@pytest.mark.parametrize("constant", [0.0, 0.1])
def test_constant_residual_has_nothing_to_correlate(constant):
    _, u = noise_and_input(16, samples=300)
    result = residual_tests(np.full(300, constant), u)
    assert result.passed
    assert (result.ljung_box, result.whiteness_p) == (0.0, 1.0)
    for test in result.tests:
        assert not test.values.any()
        assert "constant: there is nothing to correlate" in test.note
    assert get_test(result, "xi_xi").note.startswith("the residual is constant")


@pytest.mark.parametrize(("sample", "value"), [(40, math.nan), (0, math.inf), (99, math.nan)])
def test_residual_that_is_missing_after_the_warm_up_is_refused(sample, value):
    e, u = noise_and_input(20, samples=100)
    e[sample] = value
    with pytest.raises(SettingsError, match=f"{value} at sample {sample}: only NaN before its first value"):
        residual_tests(e, u)


def test_error_for_a_non_finite_input_names_sample_and_channel():
    e, u = noise_and_input(21, samples=100, inputs=2)
    e[:5], u[30, 1] = math.nan, math.inf
    with pytest.raises(SettingsError, match="input 1 is not finite at sample 30"):
        residual_tests(e, u)


@pytest.mark.parametrize("warm_up", [74, 100])
def test_too_few_residuals_for_the_lags_are_refused(warm_up):
    e, u = noise_and_input(22, samples=100)
    e[:warm_up] = math.nan
    with pytest.raises(SettingsError, match=f"{100 - warm_up} residuals after the warm-up are too few"):
        residual_tests(e, u)


def test_inconsistent_shapes_are_refused():
    e, u = noise_and_input(24, samples=100)
    with pytest.raises(SettingsError, match=r"got \(100,\) and \(100,\)"):
        residual_tests(e, u[:, 0])
    with pytest.raises(SettingsError, match=r"got \(100,\) and \(99, 1\)"):
        residual_tests(e, u[1:])


def test_largest_lag_below_1_is_refused():
    with pytest.raises(SettingsError, match="at least 1 sample, got 0"):
        residual_tests(*noise_and_input(25, samples=100), max_lag=0)
