"""Free runs of several segments in lanes: the errors are those of each segment alone."""

import numpy as np
import pytest

from islands.models.unit_functions import FUNCTIONS, find_codes
from islands.simulation.initial_states import Segment, simulate_errors
from islands.simulation.segment_lanes import SegmentLanes

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

STATES, INPUTS = 3, 2


def make_theta(units, seed=0):
    """Return the parameters of a stable system."""
    rng = np.random.default_rng(seed)
    a = np.diag(rng.uniform(0.3, 0.8, STATES)) + 0.05 * rng.standard_normal((STATES, STATES))
    others = STATES * (INPUTS + 2 + units) + INPUTS + units * (2 + STATES + INPUTS) + 1
    return np.append(a, 0.2 * rng.standard_normal(others))


def make_segments(lengths, rng):
    """Return segments with missing outputs."""
    segments = []
    for rows in lengths:
        y = rng.standard_normal(rows)
        y[:: 1 + rows // 4] = np.nan
        segments.append(Segment(rng.standard_normal((rows, INPUTS)), y, -1.0, 1.5))
    return segments


@pytest.mark.parametrize("unit", [*FUNCTIONS, "tanh(square)", "s*abs", "bell*s*tanh(s*cube)"])
@pytest.mark.parametrize("lengths", [(40,), (90, 30, 60), tuple(range(20, 31))])
def test_the_errors_are_those_of_each_segment_alone(unit, lengths):
    rng, codes = np.random.default_rng(7), find_codes([unit, unit])
    segments, theta = make_segments(lengths, rng), make_theta(2)
    starts = rng.standard_normal((len(segments), STATES))
    lanes = SegmentLanes(segments)
    alone = [
        np.nansum(simulate_errors(theta, codes, each, start) ** 2)
        for each, start in zip(segments, starts, strict=True)
    ]
    assert lanes.sum_squared_errors(theta, codes, starts) == pytest.approx(alone, rel=1e-12)
    assert lanes.counts.tolist() == [np.count_nonzero(~np.isnan(each.y)) for each in segments]


def test_the_errors_of_a_divergence_are_missing():
    theta = make_theta(0)
    theta[0] = 1.5
    codes, rng = np.array([], np.int64), np.random.default_rng(2)
    starts = np.ones((2, STATES))
    assert SegmentLanes(make_segments((200, 30), rng)).sum_squared_errors(theta, codes, starts) is None


def test_a_state_may_diverge_after_the_end_of_its_segment():
    # Without input, the first system returns to rest; from a large state, the cube diverges.
    rng = np.random.default_rng(3)
    theta = np.array([0.5, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    long, short = (Segment(np.zeros((rows, 1)), rng.standard_normal(rows)) for rows in (60, 4))
    starts, codes = np.array([[0.1], [0.9]]), find_codes(["cube"])
    alone = [
        simulate_errors(theta, codes, each, start) for each, start in zip((long, short), starts, strict=True)
    ]
    found = SegmentLanes([long, short]).sum_squared_errors(theta, codes, starts)
    assert simulate_errors(theta, codes, Segment(long.u, long.y), starts[1]) is None
    assert found == pytest.approx([np.sum(each**2) for each in alone])
