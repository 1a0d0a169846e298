"""Range of the data: bands keep their width inside of it, and widen outside."""

import numpy as np
import pytest

from islands.records.dataset import Dataset, join
from islands.records.preprocessing import preprocess
from islands.validation.data_range import DataRange, measure_range

#: Range of 2 of the output and of 4 of the only input.
RANGE = DataRange((-1.0, 1.0), ((0.0, 4.0),), 1.0, 5.0)


def record(u):
    return Dataset(np.array(u, float), np.zeros(len(u)), 0.1)


@pytest.mark.parametrize(("u", "run"), [(0.0, 1.2), (0.0, -1.2), (4.4, 0.0), (-0.4, 0.0)])
def test_the_error_grows_as_a_chebyshev_polynomial_outside(u, run):
    """A tenth of a range beyond a limit is 1.2 half-ranges from the centre."""
    expected = np.cosh(4.0 * np.arccosh(1.2)) ** 2 - 1.0
    assert RANGE.increase(record([u]), np.array([run])) == pytest.approx([expected])


def test_an_excess_decays_over_the_memory_of_its_segment():
    two = join((record([0.0, 4.8, 0.0, 0.0, 4.1]), record([0.0, 0.0])))
    found = RANGE.increase(two, np.zeros(7))
    each = [RANGE.increase(record([4.0 + 4.0 * 0.2 * np.exp(-k / 5.0)]), np.zeros(1))[0] for k in range(4)]
    assert found == pytest.approx([0.0, *each, 0.0, 0.0], abs=1e-9)


def test_a_band_is_finite_however_far_a_signal_is_outside_of_the_range():
    found = RANGE.increase(record([0.0, 1e60, 1e300]), np.array([np.nan, 0.0, np.inf]))
    assert found[0] == 0.0
    assert found[1] == found[2] < np.inf


def test_the_range_is_that_of_measured_and_simulated_signals():
    """NaN of a warm-up, and the value of an input that does not change, have no effect."""
    parts = [Dataset(np.full(3, 2.0), np.array([0.0, 1.0, 2.0]), 0.1) for _ in range(2)]
    found = measure_range(parts, [np.array([np.nan, -1.0, 0.0]), np.array([np.nan, 0.0, 1.5])], 0.5, 3.0)
    assert found == DataRange((-1.0, 2.0), ((2.0, 2.0),), 0.5, 3.0)
    assert found.increase(record([7.0]), np.array([1.0])) == [0.0]


def test_the_range_of_deviations_is_that_of_the_measured_signals():
    rng = np.random.default_rng(0)
    measured = Dataset(5.0 + rng.standard_normal(50), 3.0 + rng.standard_normal(50), 0.1)
    deviations = preprocess(measured, detrend="constant")
    one, other = (measure_range([each], [each.y], 1.0, 1.0) for each in (measured, deviations))
    assert one.output == pytest.approx(other.output)
    assert one.inputs[0] == pytest.approx(other.inputs[0])
    assert one.increase(deviations, deviations.y + 1.0) == pytest.approx(
        one.increase(measured, measured.y + 1.0)
    )
