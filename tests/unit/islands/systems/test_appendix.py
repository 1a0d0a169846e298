"""Test systems of appendix A: recursions, inputs and noise."""

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.systems import appendix
from islands.systems.appendix import S1, S2


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


def test_noise_std_is_fixed_for_s1_and_a_fifth_of_the_output_for_s2():
    output = np.array([-3.0, 3.0])
    assert S1.noise_std(output) == 0.02
    assert S2.noise_std(output) == pytest.approx(0.2 * 3.0)


def snr_of_variances(signal, noise):
    """Return the paper's signal-to-noise ratio: 20 log10 of a ratio of variances."""
    return 20 * np.log10(signal.var() / noise.var())


def test_quoted_snr_of_s2_follows_from_its_noise_variance():
    quoted = 28.05
    records = [appendix.white_record(S2, seed) for seed in range(50)]
    clean = [S2.simulate(record.u[:, 0]) for record in records]
    snr = [snr_of_variances(y, record.y - y) for y, record in zip(clean, records, strict=True)]
    assert np.mean(snr) == pytest.approx(quoted, abs=0.3)


def test_inverse_filter_of_the_unit_gain_input_returns_white_noise():
    u = appendix.soft_input(4, "unit-gain", samples=300)
    one_pole = u.copy()
    one_pole[1:] -= 0.95 * u[:-1]
    white = one_pole.copy()
    white[1:] -= 0.9 * one_pole[:-1]
    white /= (1 - 0.95) * (1 - 0.9)
    assert white.var() == pytest.approx(0.20, rel=0.25)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 3 / np.sqrt(300)


def test_unknown_scaling_error_lists_the_known_scalings():
    with pytest.raises(SettingsError, match=r"'raw'.*rescaled, unit-gain"):
        appendix.soft_input(0, "raw")


def test_diverging_system_raises_an_error():
    diverging = appendix.OutputErrorSystem("s1", lambda u: appendix.simulate_s1(u - 1e3), S1.noise_std)
    with pytest.raises(RecordError, match=r"s1 diverged at sample \d+"):
        appendix.soft_record(diverging)
