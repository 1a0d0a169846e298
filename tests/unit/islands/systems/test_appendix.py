"""Test systems of appendix A: recursions, inputs and noise."""

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.systems import appendix
from islands.systems.appendix import S1, S2

BOTH = pytest.mark.parametrize("system", [S1, S2], ids=lambda system: system.name)


def snr_of_variances(signal, noise):
    """Return the paper's signal-to-noise ratio: 20 log10 of a ratio of variances."""
    return 20 * np.log10(signal.var() / noise.var())


def test_s1_is_the_recursion_of_the_paper():
    u = np.array([1.0, -2.0, 0.5, 3.0, 0.0, 0.0])
    second = 0.25 * -2.0  # y[0] = 0, so only the input contributes
    third = 0.75 * 0.25 + 0.25 * 0.5 - 0.2 * 0.25 * 0.5
    fourth = 0.75 * second + 0.25 * 3.0 - 0.2 * second * 3.0
    fifth = 0.75 * third
    np.testing.assert_allclose(appendix.simulate_s1(u), [0.0, 0.25, second, third, fourth, fifth], rtol=1e-14)


def test_s2_is_the_recursion_of_the_paper():
    u = np.zeros(15)
    u[0], u[1] = 1.0, 2.0
    third = 1.0 * 2.0 * (2.5 + 2.0) / (1 + 1.0 + 4.0)
    fourth = third * 2.0 * (2.5 + third) / (1 + third**2 + 4.0)
    np.testing.assert_allclose(appendix.simulate_s2(u), [0.0] * 11 + [1.0, 2.0, third, fourth], rtol=1e-14)


@BOTH
def test_noise_does_not_enter_the_recursion(system):
    record = appendix.soft_record(system, seed=3)
    clean = system.simulate(record.u[:, 0])
    error = record.y - clean
    assert error.std() == pytest.approx(system.noise_std(clean), rel=0.15)
    # White noise: the correlation of adjacent samples is within three standard deviations.
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 3 / np.sqrt(len(error))


def test_noise_std_is_fixed_for_s1_and_a_fifth_of_the_output_for_s2():
    output = np.array([-3.0, 3.0])
    assert S1.noise_std(output) == 0.02
    assert S2.noise_std(output) == pytest.approx(0.2 * 3.0)


def test_quoted_snr_of_s1_is_that_of_the_white_input():
    quoted = 51.47
    snr = [
        20 * np.log10(appendix.simulate_s1(appendix.white_input(seed)).var() / 0.02**2) for seed in range(200)
    ]
    assert np.mean(snr) == pytest.approx(quoted, abs=0.5)


def test_quoted_snr_of_s2_follows_from_its_noise_variance():
    quoted = 28.05
    records = [appendix.white_record(S2, seed) for seed in range(50)]
    clean = [S2.simulate(record.u[:, 0]) for record in records]
    snr = [snr_of_variances(y, record.y - y) for y, record in zip(clean, records, strict=True)]
    assert np.mean(snr) == pytest.approx(quoted, abs=0.3)


def test_rescaled_input_is_closer_to_the_quoted_snr_than_unit_gain():
    def median_snr(scaling):
        outputs = [appendix.simulate_s1(appendix.soft_input(seed, scaling)) for seed in range(50)]
        return np.median([20 * np.log10(y.var() / 0.02**2) for y in outputs])

    # Counts and sizes of the paper, not this ratio, decide the variance; no value meets all of them.
    assert 12.0 < 51.47 - median_snr("rescaled") < 20.0
    assert 51.47 - median_snr("unit-gain") > 30.0


@pytest.mark.parametrize("variance", [appendix.SOFT_VARIANCE, 0.2])
def test_rescaled_input_has_the_given_variance(variance):
    assert appendix.soft_input(0, variance=variance).var() == pytest.approx(variance, rel=1e-12)
    record = appendix.soft_record(S1, 3, variance=variance)
    assert record.u[:, 0].var() == pytest.approx(variance, rel=1e-12)
    assert np.array_equal(appendix.soft_record(S1, 3).u, record.u) == (variance == appendix.SOFT_VARIANCE)


def test_unit_gain_ignores_the_variance_of_the_rescaled_input():
    one, other = (appendix.soft_input(2, "unit-gain", variance=variance) for variance in (0.1, 0.2))
    assert np.array_equal(one, other)


def test_inverse_filter_of_the_unit_gain_input_returns_white_noise():
    u = appendix.soft_input(4, "unit-gain", samples=300)
    one_pole = u.copy()
    one_pole[1:] -= 0.95 * u[:-1]
    white = one_pole.copy()
    white[1:] -= 0.9 * one_pole[:-1]
    white /= (1 - 0.95) * (1 - 0.9)
    assert white.var() == pytest.approx(0.20, rel=0.25)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 3 / np.sqrt(300)


def test_scalings_differ_only_by_a_factor():
    rescaled, unit = appendix.soft_input(5, "rescaled"), appendix.soft_input(5, "unit-gain")
    np.testing.assert_allclose(rescaled / rescaled[0], unit / unit[0], rtol=1e-9)
    assert rescaled[0] / unit[0] == pytest.approx(np.sqrt(appendix.SOFT_VARIANCE / unit.var()))


def test_unknown_scaling_error_lists_the_known_scalings():
    with pytest.raises(SettingsError, match=r"'raw'.*rescaled, unit-gain"):
        appendix.soft_input(0, "raw")


@BOTH
@pytest.mark.parametrize("scaling", appendix.SCALINGS)
def test_both_systems_stay_bounded_for_fifty_seeds(system, scaling):
    for seed in range(50):
        assert np.abs(system.simulate(appendix.soft_input(seed, scaling))).max() < 25.0
        assert np.abs(system.simulate(appendix.white_input(seed))).max() < 25.0


def test_diverging_system_raises_an_error():
    diverging = appendix.OutputErrorSystem("s1", lambda u: appendix.simulate_s1(u - 1e3), S1.noise_std)
    with pytest.raises(RecordError, match=r"s1 diverged at sample \d+"):
        appendix.soft_record(diverging)


def test_records_of_different_seeds_and_purposes_are_independent():
    soft, white = appendix.soft_record(S1, 0), appendix.white_record(S1, 0)
    other = appendix.white_record(S1, 1)
    draws = [
        appendix.soft_input(0),
        soft.y - S1.simulate(soft.u[:, 0]),
        white.u[:, 0],
        white.y - S1.simulate(white.u[:, 0]),
        other.u[:, 0],
    ]
    correlation = np.abs(np.corrcoef(draws) - np.eye(len(draws)))
    # The tolerance is large because the soft input has few independent samples.
    assert correlation.max() < 0.3
