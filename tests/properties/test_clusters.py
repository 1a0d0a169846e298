"""Properties of clusters: steady states of regressors (the paper, section 3)."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.expressions.parsing import parse
from islands.models.clusters import OUTPUT_AT_REST, clusters, steady_state
from islands.models.regressor import regressor
from support.strategies import grid, nearly, regressors, settled_value, signals


def make_regressor(expression):
    return regressor(expression)[1]


@given(regressors(), signals())
def test_weighted_steady_state_is_the_value_for_constant_signals(item, signal):
    def rest(channel, _lag):
        return signal(channel, 0)

    expected = settled_value(item.expression, rest)
    weight, state = steady_state(item)
    found = settled_value(state, rest)
    assume(expected is not None and found is not None)
    assert nearly(weight * found, expected)


@pytest.mark.ci
@given(
    st.lists(regressors(height=2), min_size=1, max_size=6), st.lists(grid, min_size=6, max_size=6), signals()
)
def test_totals_of_clusters_give_the_model_in_steady_state(found, theta, signal):
    def rest(channel, _lag):
        return signal(channel, 0)

    values = [settled_value(item.expression, rest) for item in found]
    partition = clusters(found)
    states = [settled_value(cluster.steady_state, rest) for cluster in partition]
    assume(None not in values and None not in states)
    parts = [parameter * number for parameter, number in zip(theta, values, strict=False)]
    sums = [cluster.total(theta) * number for cluster, number in zip(partition, states, strict=True)]
    assert sum(sums) == pytest.approx(sum(parts), rel=1e-6, abs=1e-6 * sum(map(abs, parts)))


def test_model_14_of_the_paper_has_its_three_clusters():
    # Section 7: clusters of output, input and their product; the phi terms vanish in steady state.
    texts = (
        "phi2(u(k-5), u(k-10))",
        "phi2(u(k-1), u(k-3))",
        "y(k-6)*u(k-10)",
        "y(k-1)*u(k-4)",
        "u(k-9)",
        "u(k-7)",
        "phi2(u(k-9), u(k-2))",
        "phi1(u(k-5), u(k-6))",
        "y(k-1)",
    )
    theta = (2.10e-2, 2.35e-2, 1.52e-4, -1.52e-4, 3.14, -3.14, -2.15e-2, 13.8, 1.00)
    found = {
        cluster.members: cluster for cluster in clusters([make_regressor(parse(text)) for text in texts])
    }
    assert set(found) == {(2, 3), (4, 5), (8,)}
    assert found[8,].steady_state == OUTPUT_AT_REST
    assert [found[members].total(theta) for members in ((2, 3), (4, 5), (8,))] == [0.0, 0.0, 1.0]
