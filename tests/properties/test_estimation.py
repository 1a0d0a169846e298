"""Properties of estimation: least squares and constrained least squares, equations (2) and (4).

Oracles: numpy's least squares, and equation (4) as it is printed, in extended precision.
"""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import RecordError
from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.estimation.least_squares import least_squares
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.models.regressor import regressor
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from support.regressions import problem, seeds, squares


def restriction(seed, constraints, terms):
    generator = np.random.default_rng(seed)
    return generator.normal(size=(constraints, terms)), generator.normal(size=constraints)


def make_regressors(*texts):
    """Return regressors of texts, in the order given."""
    return [regressor(parse(text))[1] for text in texts]


# Least squares, equation (2).


@given(seeds, st.integers(1, 8))
def test_least_squares_agrees_with_numpy(seed, terms):
    psi, y = problem(seed, terms)
    found = least_squares(psi, y)
    assert found.outcome == OK
    np.testing.assert_allclose(found.theta, np.linalg.lstsq(psi.T, y, rcond=None)[0], rtol=1e-9, atol=1e-11)
    expected = squares(psi, y, found.theta) / (psi.shape[1] - terms)
    assert found.residual_variance == pytest.approx(expected, rel=1e-10)


def test_least_squares_is_accurate_if_normal_equations_are_singular():
    psi, _ = problem(0, 4)
    psi[3] = psi[0] + 1e-8 * psi[3]
    assert np.linalg.cond(psi @ psi.T) > 1e15
    found = least_squares(psi, np.array([1.0, -2.0, 3.0, 0.5]) @ psi)
    np.testing.assert_allclose(found.theta, [1.0, -2.0, 3.0, 0.5], rtol=0, atol=1e-6)


@pytest.mark.parametrize("layout", ["C", "F"])
@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_memory_layout_and_integer_data_have_no_effect(layout, kind):
    psi, y = (np.round(10 * item) for item in problem(1))
    expected = least_squares(psi, y)
    found = least_squares(np.array(psi, dtype=kind, order=layout), y.astype(kind))
    assert np.array_equal(found.theta, expected.theta)
    assert np.array_equal(found.standard_errors, expected.standard_errors)


def test_estimation_does_not_modify_its_arguments():
    psi, y = problem(2)
    S, c = restriction(2, 2, 5)
    arguments = (psi, y, S, c)
    copies = [item.copy() for item in arguments]
    for item in arguments:
        item.setflags(write=False)
    assert constrained_least_squares(*arguments).outcome
    for item, copy in zip(arguments, copies, strict=True):
        assert np.array_equal(item, copy)


def test_target_of_another_length_raises_record_error():
    psi, y = problem(3)
    for wrong in (y[:-1], np.append(y, 0.0), y[:, None]):
        with pytest.raises(RecordError, match=r"has 120 rows, the target has shape \("):
            least_squares(psi, wrong)


@pytest.mark.parametrize("constrained", [False, True])
def test_standard_errors_are_the_standard_deviations_of_estimates(constrained):
    # The standard deviation of 300 repetitions has an error of 1 / sqrt(2 * 300) = 4 %; three times it is
    # allowed.
    psi, clean = problem(4, 4, 240, noise=0.0)
    S, c = restriction(4, 1, 4)
    if constrained:
        clean = np.linalg.lstsq(np.vstack([psi.T, 1e6 * S]), np.append(clean, 1e6 * c), rcond=None)[0] @ psi
    found = []
    for seed in range(300):
        y = clean + 0.2 * np.random.default_rng(seed).normal(size=240)
        found.append(constrained_least_squares(psi, y, S, c) if constrained else least_squares(psi, y))
    spread = np.std([estimate.theta for estimate in found], axis=0, ddof=1)
    claimed = np.sqrt(np.mean([estimate.standard_errors**2 for estimate in found], axis=0))
    np.testing.assert_allclose(claimed, spread, rtol=0.12)
    assert np.mean([estimate.residual_variance for estimate in found]) == pytest.approx(0.04, rel=0.05)


@pytest.mark.parametrize("estimate", [least_squares, lambda psi, y: constrained_least_squares(psi, y, *SUM)])
def test_dependent_regressor_is_named(estimate):
    psi, y = problem(6, 4)
    psi[2] = psi[0] - 2.0 * psi[1]
    found = estimate(psi, y)
    assert found.outcome == EvaluationOutcome(Status.SINGULAR, "regressor 3 depends on those before it")
    assert np.isnan(found.theta).tolist() == [True] * 4


#: The parameters of four terms sum to one.
SUM = (np.ones((1, 4)), np.ones(1))


# Constrained least squares, equation (4).


def inverse(matrix):
    """Invert in extended precision by Gauss and Jordan, with pivots from the column."""
    size = len(matrix)
    work = np.hstack([matrix.astype(np.longdouble), np.eye(size, dtype=np.longdouble)])
    for column in range(size):
        pivot = column + int(np.argmax(np.abs(work[column:, column])))
        work[[column, pivot]] = work[[pivot, column]]
        work[column] /= work[column, column]
        for row in range(size):
            if row != column:
                work[row] -= work[row, column] * work[column]
    return work[:, size:]


def equation_4(psi, y, S, c):
    """Evaluate equation (4) as it is printed."""
    Psi, target, S = psi.T.astype(np.longdouble), y.astype(np.longdouble), S.astype(np.longdouble)
    spread = inverse(Psi.T @ Psi)
    free = spread @ (Psi.T @ target)
    return free - spread @ S.T @ inverse(S @ spread @ S.T) @ (S @ free - c)


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("constraints", [1, 3])
def test_constrained_least_squares_is_equation_4(seed, constraints):
    psi, y = problem(seed, 5)
    S, c = restriction(seed + 1, constraints, 5)
    found, expected = constrained_least_squares(psi, y, S, c), equation_4(psi, y, S, c)
    np.testing.assert_allclose(found.theta, expected.astype(float), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("size", [1e-13, 1.0, 1e13])
@pytest.mark.parametrize(
    ("S", "c", "reason"),
    [
        ([[1, 1, 0, 0], [0, 0, 0, 0]], [1, 0], "constraint 2 names no regressor"),
        ([[0, 0, 0, 0]], [1], "constraint 1 names no regressor"),
        ([[1, 1, 0, 0], [2, 2, 0, 0]], [1, 2], "constraint 2 is a combination of the others: leave it out"),
        ([[1, 1, 0, 0], [1, 1, 0, 0]], [0, 0], "constraint 2 is a combination of the others: leave it out"),
        ([[1, 1, 0, 0], [1, 1, 0, 0]], [1, 2], "constraint 2 contradicts the others"),
        ([[1, 1, 0, 0], [1, 1, 0, 0]], [0, 1], "constraint 2 contradicts the others"),
    ],
)
def test_infeasible_constraints_are_outcomes_with_a_reason(S, c, reason, size):
    # The outcome does not depend on the unit of the regressors.
    psi, y = problem(8, 4)
    found = constrained_least_squares(size * psi, y, np.array(S, float), np.array(c, float))
    assert found.outcome == EvaluationOutcome(Status.INFEASIBLE, reason)
    assert np.isnan(found.theta).all()


@given(seeds, st.booleans())
def test_redundant_and_contradictory_constraints_are_distinguished(seed, contradicts):
    psi, y = problem(seed, 6)
    S, c = restriction(seed + 1, 3, 6)
    weights = np.random.default_rng(seed + 2).normal(size=3)
    S, c = np.vstack([S, weights @ S]), np.append(c, weights @ c + 0.01 * contradicts)
    outcome = constrained_least_squares(psi, y, S, c).outcome
    assert outcome.verdict is Status.INFEASIBLE
    assert outcome.reason.endswith("contradicts the others" if contradicts else "others: leave it out")


def test_zero_constraints_equal_least_squares_bit_for_bit():
    psi, y = problem(11)
    found, free = constrained_least_squares(psi, y, np.empty((0, 5)), np.empty(0)), least_squares(psi, y)
    assert np.array_equal(found.theta, free.theta)
    assert np.array_equal(found.standard_errors, free.standard_errors)


# Units.

TERMS = {
    "y(k-1)": (0, 1),
    "y(k-3)": (0, 1),
    "u(k-1)": (1, 0),
    "u(k-2)^2*y(k-1)": (2, 1),
    "sign(u(k-1) - u(k-2))": (0, 0),
    "(u(k-1) - u(k-2))*y(k-1)^2": (1, 2),
    "abs(u(k-3))*sign(y(k-1))": (1, 0),
}


def measured(volts=1.0, metres=1.0):
    generator = np.random.default_rng(18)
    u = generator.normal(size=400)
    y = np.zeros(400)
    for k in range(3, 400):
        y[k] = 0.6 * y[k - 1] - 0.1 * y[k - 3] + u[k - 1] + 0.1 * u[k - 2] ** 2 * np.tanh(y[k - 1])
        y[k] += 0.3 * np.sign(u[k - 1] - u[k - 2]) + 0.2 * generator.normal()
    return Dataset(volts * u, metres * y, 0.1)


@pytest.mark.parametrize(("volts", "metres"), [(1e3, 1.0), (1.0, 1e-6), (58.8, 4.7e-5), (1e-4, 1e5)])
def test_theta_scales_with_the_units_of_the_record(volts, metres):
    terms = [*make_regressors(*TERMS), Lagged(0, 0)]
    here, there = (regressor_matrix(terms, item, 3) for item in (measured(), measured(volts, metres)))
    factor = np.array([metres / (volts**a * metres**b) for a, b in TERMS.values()])
    S = np.array([[1.0, 1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0, 1.0]])
    c = np.array([0.9, 0.0])
    for method in (
        lambda psi: least_squares(psi[:-1], psi[-1]),
        lambda psi: constrained_least_squares(psi[:-1], psi[-1], S, c),
    ):
        before, after = method(here), method(there)
        np.testing.assert_allclose(after.theta, factor * before.theta, rtol=1e-8, atol=0)
        np.testing.assert_allclose(after.standard_errors, factor * before.standard_errors, rtol=1e-8, atol=0)
        assert after.residual_variance == pytest.approx(metres**2 * before.residual_variance, rel=1e-10)


# Bits do not depend on the number of threads.

DIGEST = """
import hashlib
import numpy as np
from islands.records.dataset import Dataset
from islands.estimation.least_squares import factorise, least_squares
from islands.expressions.tree import (Lagged)
from islands.models.regressor import regressor
from islands.expressions.parsing import parse
from islands.program.regressor_matrix import gram_matrix, regressor_matrix

texts = ["y(k-1)", "y(k-2)", "u(k-1)", "u(k-1)*y(k-1)", "u(k-2)^3", "sign(u(k-1) - u(k-2))"]
terms = [*(regressor(parse(text))[1] for text in texts), Lagged(0, 0)]
u, y = np.random.default_rng(0).normal(size=(2, 60_000)).cumsum(axis=1) / 100
record = Dataset(u, y, 0.1)
psi = regressor_matrix(terms, record, 2)
qr = factorise(psi[:-1], psi[-1])
errors = least_squares(psi[:-1], psi[-1]).standard_errors
parts = [errors, qr.triangle, qr.scale, qr.projection, np.array(qr.residual), gram_matrix(terms, record, 2)]
print(hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest(), qr.residual)
"""


@pytest.mark.ci
def test_long_sums_do_not_depend_on_the_number_of_threads(capsys):
    # This process uses the number of linear-algebra threads it was started with, usually one.
    exec(DIGEST, {})
    here = capsys.readouterr().out.split()
    threads = "1" if os.environ.get("OPENBLAS_NUM_THREADS") == "2" else "2"
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, threads)
    done = subprocess.run(
        [sys.executable, "-c", DIGEST], env=environment, capture_output=True, text=True, check=True
    )
    assert len(here[0]) == 64
    assert float(here[1]) > 0.0
    assert done.stdout.split() == here
