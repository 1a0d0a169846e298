"""Rate limiter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.systems.rate_limiter import limit_rate

Array = NDArray[np.float64]

paths = st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=60).map(np.array)
steps = st.floats(0.05, 10.0)


@given(paths, steps)
def test_the_output_keeps_the_limit_and_the_range_of_the_input(u: Array, step: float) -> None:
    x = limit_rate(u, step)
    assert x[0] == u[0]
    assert np.abs(np.diff(x)).max() <= step * (1.0 + 1e-12) + 1e-12
    assert x.min() >= u.min() - 1e-9
    assert x.max() <= u.max() + 1e-9


@given(paths)
def test_an_input_within_the_limit_is_unchanged(u: Array) -> None:
    assert np.array_equal(limit_rate(u, float(np.abs(np.diff(u)).max())), u)


@given(paths, steps, st.integers(2, 5))
def test_the_output_does_not_depend_on_oversampling(u: Array, step: float, factor: int) -> None:
    """The limiter acts between samples as well: the same path with more samples has the same output."""
    finer = np.interp(np.arange((u.size - 1) * factor + 1) / factor, np.arange(u.size), u)
    assert limit_rate(finer, step / factor)[::factor] == pytest.approx(limit_rate(u, step), abs=1e-9)


def test_a_step_becomes_a_ramp() -> None:
    u = np.repeat([0.0, 1.0], [2, 6])
    assert limit_rate(u, 0.25) == pytest.approx([0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0])
