"""Dependent parameters: the products of their derivatives are those of derivatives that are propagated."""

import numpy as np
import pytest

from islands.kernels.dependent_parameters import extend_products, find_dependent
from islands.kernels.state_space import BELL, TANH
from islands.kernels.state_space_products import NO_DERIVATIVES, accumulate_products
from islands.models.latent import StateSpaceLayout
from islands.simulation.initial_states import Segment
from islands.simulation.segment_lanes import SegmentLanes

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

SEGMENTS, ROWS = 3, 200


class System:
    """A stable system with fixed parameters, which are zero, and segments of a record."""

    def __init__(self, order, inputs, codes, fixed=()):
        rng = np.random.default_rng(order)
        self.codes = np.array(codes, np.int64)
        layout = StateSpaceLayout(order, inputs, len(codes))
        self.theta, free = 0.3 * rng.standard_normal(len(layout.names)), np.ones(len(layout.names), bool)
        layout.split(self.theta)["A"][...] = np.diag(rng.uniform(0.5, 0.9, order))
        layout.split(self.theta)["A"][...] += 0.03 * rng.standard_normal((order, order))
        for name in fixed:
            layout.split(free)[name][...] = np.eye(order) if name == "A" else False
        self.theta[~free] = 0.0
        self.places = np.where(free, np.cumsum(free) - 1, -1)
        self.columns = int(free.sum())
        pairs = ((rng.standard_normal((ROWS, inputs)), rng.standard_normal(ROWS)) for _ in range(SEGMENTS))
        self.segments = SegmentLanes(Segment(u, y) for u, y in pairs)
        self.states = rng.standard_normal((SEGMENTS, order))
        self.inputs = inputs

    def accumulate(self, places, columns):
        """Return the products of the columns of all segments."""
        size = columns + self.states.shape[1] + 1
        found = np.empty((SEGMENTS, size, size))
        traces = self.segments.trace(self.theta, self.codes, self.states)
        for lane, (segment, products) in enumerate(zip(self.segments, found, strict=True)):
            accumulate_products(
                *(self.theta, places, len(self.codes), traces, lane, segment.u, segment.y),
                *(-np.inf, np.inf, columns, products, NO_DERIVATIVES),
            )
        return found

    def find(self):
        """Return the directions and the dependent columns."""
        order = self.states.shape[1]
        directions = np.empty((order * (order + 1), self.columns + self.states.size))
        dependent = np.empty(len(directions), np.int64)
        sizes = self.inputs, len(self.codes), self.states, self.columns
        count = find_dependent(self.theta, self.places, *sizes, directions, dependent)
        return directions[:count], dependent[:count]


@pytest.mark.parametrize(
    ("order", "codes", "fixed", "count"),
    [
        (1, (), (), 2),
        (3, (TANH, BELL), (), 12),
        (6, (TANH, BELL), (), 42),
        # Without offsets, the states cannot be shifted.
        (3, (TANH, BELL), ("o", "s", "level"), 9),
        (2, (), ("D",), 6),
        # A state that is added to another one would change an entry between two modes.
        (2, (TANH,), ("A",), 4),
    ],
)
def test_the_products_are_those_of_all_derivatives(order, codes, fixed, count):
    system = System(order, 2, codes, fixed)
    directions, dependent = system.find()
    assert len(dependent) == len(set(dependent.tolist())) == count
    columns = system.columns
    others = np.setdiff1d(np.arange(columns), dependent)
    rank = np.full(columns + 1, -1)
    rank[others] = range(len(others))
    reduced = system.accumulate(rank[system.places], len(others))
    own_rows, total = np.empty((SEGMENTS, order, columns + order + 1)), np.empty((columns, columns + 1))
    combinations = directions[:, [*others, *range(columns, directions.shape[1])]]
    extend_products(reduced, combinations, own_rows, total)
    places = np.array([*others, *dependent], int)
    expected = system.accumulate(system.places, columns)
    all_columns = [*places, *range(columns, columns + order + 1)]
    scale = np.abs(expected).max()
    assert own_rows == pytest.approx(expected[:, columns:-1][:, :, all_columns], abs=1e-12 * scale)
    summed = expected.sum(axis=0)[:, [*places, -1]][places]
    upper = np.triu(np.ones(total.shape, bool))
    assert total[upper] == pytest.approx(summed[upper], abs=1e-12 * scale)


def test_a_combination_has_no_large_coefficients():
    directions, dependent = System(6, 1, (TANH, BELL)).find()
    assert np.array_equal(directions[:, dependent], np.eye(42))
    assert np.abs(directions).max() < 1e3
