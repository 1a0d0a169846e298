"""Properties of parameter constraints: Property 1 of the paper, section 3, and the null space."""

import numpy as np
import pytest

from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.estimation.constraints.conditions import Constraint
from islands.estimation.constraints.parts import ClusterSums
from islands.estimation.least_squares import least_squares
from islands.estimation.parameter_constraints import CONSTRAINTS, constraint
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.expressions.tree import Lagged
from islands.models.clusters import steady_state
from islands.models.narx import make_model
from islands.models.regressor import regressor
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.predictors import free_run


def make_regressors(*texts):
    """Return regressors of texts, in the order given."""
    return [regressor(parse(text))[1] for text in texts]


MODEL_14 = make_regressors(
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


def hysteresis(*texts):
    return CONSTRAINTS["hysteresis"].constrain(make_regressors(*texts))


@pytest.mark.parametrize("texts", [["u(k-1)", "u(k-2)"], ["y(k-1)^2", "y(k-2)^2"], ["phi1(u(k-1), u(k-2))"]])
def test_structure_without_y_is_infeasible(texts):
    found = hysteresis(*texts)
    assert found == EvaluationOutcome(Status.INFEASIBLE, "no regressor is y at rest: add y(k-1)")
    assert "change either as the reason says" in str(found)


def test_constrained_estimate_has_every_output_as_equilibrium():
    generator = np.random.default_rng(10)
    u = np.cumsum(generator.normal(size=400)) / 5
    y = 0.8 * np.roll(u, 2) + 0.1 * generator.normal(size=400)
    record = Dataset(u, y, 0.1)
    found = CONSTRAINTS["hysteresis"].constrain(MODEL_14)
    psi = regressor_matrix([*found.regressors, Lagged(0, 0)], record, 10)
    theta = constrained_least_squares(psi[:-1], psi[-1], found.S, found.c).theta
    chosen = make_model(
        (item.expression, float(weight)) for item, weight in zip(MODEL_14, theta, strict=True)
    )
    for level in (-2.0, 0.0, 3.0):
        held = free_run(chosen, Dataset(np.full(200, 1.5), np.full(200, level), 0.1)).y[10:]
        np.testing.assert_allclose(held, level, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_constraints_are_found_by_name(name):
    assert constraint(name) is CONSTRAINTS[name]
    assert constraint(name).description


# User-defined constraints.


def first_signal(item):
    """Group regressors by their first signal, with the degree as weight; constants have no group."""
    channels = sorted(channel for channel, _ in item.lags)
    return (float(item.degree), Lagged(channels[0], 0)) if channels else (0.0, Lagged(0, 0))


def make_constraint(**sums):
    by_signal = {Lagged(int(name[1:]), 0): total for name, total in sums.items()}
    return Constraint((ClusterSums("", first_signal, by_signal, "none"),))


def test_user_defined_constraint_sets_the_sums_of_its_groups():
    items = make_regressors("y(k-1)", "u1(k-1)", "y(k-1)*u2(k-3)", "u1(k-2)^2", "1", "u2(k-1)")
    found = make_constraint(c0=0.5, c1=-2.0, c2=3.0).constrain(items)
    assert found.regressors == tuple(items)
    assert found.S.tolist() == [
        [1.0, 0.0, 2.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 2.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
    assert found.c.tolist() == [0.5, -2.0, 3.0]


@pytest.mark.parametrize("sums", [{"c1": 1.0}, {"c0": 1.0, "c2": 0.5}])
def test_structure_without_a_required_group_is_infeasible(sums):
    assert make_constraint(**sums).constrain(make_regressors("y(k-1)", "y(k-2)")) == EvaluationOutcome(
        Status.INFEASIBLE, "none"
    )


# Null space, for selection.

LIBRARY = make_regressors(
    "y(k-1)",
    "y(k-2)",
    "y(k-4)",
    "y(k-2) + 0.5*y(k-3)",
    "u(k-1) + 0.5*u(k-3)",
    "u(k-1)",
    "u(k-2)",
    "y(k-1)*u(k-1)",
    "y(k-2)*u(k-1)",
    "phi2(u(k-1), u(k-2))",
    "u(k-1)*phi1(u(k-1), u(k-2))",
)


def test_directions_of_hysteresis_vanish_in_steady_state():
    found = CONSTRAINTS["hysteresis"].directions(LIBRARY)
    assert [plain(item.expression) for item in found.fixed] == ["y(k-1)"]
    # One direction per regressor, except the first of each of the three clusters.
    assert len(found.free) == len(LIBRARY) - 3
    for direction in found.free:
        assert abs(steady_state(regressor(direction.expression)[1])[0]) < 1e-15


def test_estimation_in_the_null_space_is_constrained_least_squares():
    generator = np.random.default_rng(12)
    record = Dataset(generator.normal(size=300), generator.normal(size=300), 0.1)
    found = CONSTRAINTS["hysteresis"].directions(LIBRARY)
    moves = regressor_matrix([*(item.expression for item in found.free), found.target], record, 4)
    free = least_squares(moves[:-1], moves[-1])
    bound = CONSTRAINTS["hysteresis"].constrain(LIBRARY)
    psi = regressor_matrix([*bound.regressors, Lagged(0, 0)], record, 4)
    constrained = constrained_least_squares(psi[:-1], psi[-1], bound.S, bound.c)
    np.testing.assert_allclose(
        moves[-1] - free.theta @ moves[:-1], psi[-1] - constrained.theta @ psi[:-1], rtol=0, atol=1e-10
    )
    assert free.residual_variance == pytest.approx(constrained.residual_variance, rel=1e-10)


def test_library_without_y_is_infeasible_under_the_constraint():
    found = CONSTRAINTS["hysteresis"].directions(make_regressors("u(k-1)", "u(k-2)"))
    assert found.verdict is Status.INFEASIBLE
    assert "add y(k-1)" in found.reason
