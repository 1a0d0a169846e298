import numpy as np
import pytest
import scipy

from islands.records.inspection.channel import channels
from islands.records.inspection.excitation import estimate_spectrum, measure_excitation
from support.known_records import measure, white


def excite(u, dt=0.01):
    record = measure(u, u, dt=dt)
    return {fact.name: fact for fact in measure_excitation(channels(record)[0], record)}


def sines(*frequencies, samples=4000, dt=0.01):
    time = dt * np.arange(samples)
    return sum(np.sin(2.0 * np.pi * frequency * time + frequency) for frequency in frequencies)


def test_band_contains_the_sines_of_an_input():
    low, high = excite(sines(2.0, 5.0, 11.0))["band"].interval
    assert 1.0 < low < 2.2
    assert 10.0 < high < 12.0


@pytest.mark.parametrize("samples", [2, 20, 201, 4096, 4097, 20_000])
@pytest.mark.parametrize("length", [16, 101, 4096])
@pytest.mark.parametrize("centres_parts", [False, True])
def test_spectrum_is_that_of_scipy(samples, length, centres_parts):
    values = 3.0 + white(samples, 1)
    frequency, power = estimate_spectrum(values, 0.01, length, centres_parts)
    centred = values if centres_parts else values - values.mean()
    detrend = "constant" if centres_parts else False
    expected = scipy.signal.welch(centred, 100.0, nperseg=min(samples, length), detrend=detrend)
    np.testing.assert_array_equal(frequency, expected[0])
    np.testing.assert_allclose(power, expected[1], atol=1e-13 * expected[1].max())


@pytest.mark.parametrize("count", [1, 2, 5])
def test_order_of_persistent_excitation_is_twice_the_number_of_sines(count):
    found = excite(sines(*(3.0 + 8.0 * place for place in range(count))))
    assert found["excitation-order"].value == 2 * count
