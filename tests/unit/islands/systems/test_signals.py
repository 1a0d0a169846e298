"""Excitation signals."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.systems import signals

DT = 1e-3


def compute_power(u):
    """Return frequencies in Hz and squared magnitudes of the spectrum of a signal sampled at DT."""
    return np.fft.rfftfreq(len(u), DT), np.abs(np.fft.rfft(u)) ** 2


def find_turning_points(u):
    """Return the values at which the signal starts, stops, turns or ends, in order."""
    direction = np.sign(np.diff(u))
    turns = np.flatnonzero(direction[1:] != direction[:-1]) + 1
    return np.concatenate([u[:1], u[turns], u[-1:]])


@pytest.mark.parametrize("zero_phase", [False, True])
def test_filtered_noise_has_no_power_above_its_cutoff(zero_phase):
    u = signals.filtered_noise(DT, 50.0, 2.0, seed=1, zero_phase=zero_phase)
    frequency, energy = compute_power(u * np.hanning(len(u)))
    assert energy[frequency > 8.0].sum() < 1e-5 * energy.sum()
    assert energy[frequency < 2.0].sum() > 0.9 * energy.sum()


def test_variance_of_unscaled_noise_follows_from_its_bandwidth():
    u = signals.filtered_noise(DT, 400.0, 20.0, seed=3)
    # White noise of variance one has a bandwidth of 500 Hz; a fifth-order Butterworth filter has a noise
    # bandwidth of (pi / 10) / sin(pi / 10) = 1.0166 times its cutoff.
    assert u.var() == pytest.approx(1.0166 * 20.0 / 500.0, rel=0.05)


def test_sines_with_sequences_of_different_length_are_refused():
    with pytest.raises(SettingsError, match="got 2, 1 and 2"):
        signals.sines(DT, 1.0, (1.0, 2.0), (3.0,))


def test_multisine_has_equal_power_in_its_band_and_none_outside():
    u = signals.multisine(DT, 2.0, period=2.0, band=(0.5, 10.0), seed=8, peak=4.0)
    frequency, energy = compute_power(u)
    inside = (frequency >= 0.5) & (frequency <= 10.0)
    assert inside.sum() == 20
    np.testing.assert_allclose(energy[inside], energy[inside][0], rtol=1e-9)
    assert energy[~inside].max() < 1e-20 * energy[inside][0]
    assert np.abs(u).max() == pytest.approx(4.0)


def test_multisine_without_a_harmonic_in_its_band_is_refused():
    with pytest.raises(SettingsError, match=r"no multiple of 1\.0 Hz"):
        signals.multisine(DT, 1.0, period=1.0, band=(1.2, 1.8), seed=0)


@pytest.mark.parametrize("level", [20.0, 0.0, -15.0])
@pytest.mark.parametrize("loading", [True, False])
def test_hold_signal_approaches_from_its_side_and_is_then_constant(level, loading):
    u = signals.hold_signal(DT, 3.0, amplitude=40.0, frequency=1.0, level=level, loading=loading)
    held = u[-3000:]
    approach = u[:-3000]
    assert (held == level).all()
    assert u[0] == 0.0
    assert approach.max() == pytest.approx(40.0)
    assert approach.min() == pytest.approx(-40.0)
    last_step = level - approach[-1]
    assert (last_step > 0) == loading
    assert abs(last_step) < 40.0 * 2 * np.pi * DT * 1.01
    assert 2000 <= len(approach) <= 3000


def test_hold_level_beyond_the_amplitude_is_refused():
    with pytest.raises(SettingsError, match=r"never reaches the level 41\.0"):
        signals.hold_signal(DT, 1.0, amplitude=40.0, frequency=1.0, level=41.0)


def test_minor_loops_turn_at_their_reversals_and_close():
    u = signals.minor_loops(DT, amplitude=40.0, frequency=1.0, reversals=(-0.5, 0.5, -0.25))
    expected = [0.0, 40.0, -40.0, 40.0, -20.0, 20.0, -10.0, 20.0, -20.0, 40.0]
    # Exact comparison: a loop is closed if the input returns bit-identically to the value at which it opened.
    assert find_turning_points(u).tolist() == expected


@pytest.mark.parametrize("reversals", [(-0.5, 0.5, 0.7), (1.0,), (-1.2,)])
def test_reversals_that_are_not_nested_are_refused(reversals):
    with pytest.raises(SettingsError, match="between the two before it"):
        signals.minor_loops(DT, amplitude=1.0, frequency=1.0, reversals=reversals)


def test_minor_loops_without_a_reversal_are_refused():
    with pytest.raises(SettingsError, match="at least one"):
        signals.minor_loops(DT, amplitude=1.0, frequency=1.0, reversals=())


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan])
def test_invalid_sampling_time_is_refused(dt):
    with pytest.raises(SettingsError, match="sampling time"):
        signals.sine(dt, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("duration", [0.0, -2.0, np.inf, np.nan])
def test_signal_without_a_sample_is_refused(duration):
    with pytest.raises(SettingsError, match="at least one sample"):
        signals.sweep(DT, duration, 1.0, 1.0, 2.0)


@pytest.mark.parametrize("cutoff", [0.0, 500.0, np.nan])
def test_cutoff_above_half_the_sampling_frequency_is_refused(cutoff):
    with pytest.raises(SettingsError, match=r"half the sampling frequency, 500\.0 Hz"):
        signals.filtered_noise(DT, 1.0, cutoff, seed=0)
