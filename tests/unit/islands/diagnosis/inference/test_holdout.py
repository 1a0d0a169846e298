"""The reduction of the error on the hold-out part: its interval, and errors whose squares vanish."""

import numpy as np
import pytest

from islands.diagnosis.inference.holdout import bound_reduction

ERRORS = np.random.default_rng(3).normal(size=200)


@pytest.mark.parametrize("scale", [1.0, 1e-170, 1e-300, 1e20])
def test_the_interval_of_a_reduction_does_not_depend_on_the_unit(scale):
    low, high = bound_reduction(scale * ERRORS, 0.5 * scale * ERRORS, np.random.default_rng(1))
    assert low == pytest.approx(50.0)
    assert high == pytest.approx(50.0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("before", "sign"), [(np.zeros(200), -1.0), (5e-324 * np.ones(200), 1.0)])
def test_errors_that_vanish_have_a_finite_reduction(before, sign):
    """Case 7510 of the fuzzing with seed 50 ended in a division of zero by zero."""
    same = bound_reduction(before, before, np.random.default_rng(1))
    assert same == (0.0, 0.0)
    gain = bound_reduction(before, 5e-324 - before, np.random.default_rng(1))
    assert np.isfinite(gain).all()
    assert np.sign(gain).tolist() == [sign, sign]
