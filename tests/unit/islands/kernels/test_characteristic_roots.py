import numpy as np
import pytest

from islands.kernels.characteristic_roots import MARGIN, converges


def feedback(*roots):
    """Return the parameters of y(k-1), y(k-2), ... whose characteristic polynomial has these roots."""
    return -np.poly(roots).real[1:]


@pytest.mark.parametrize(
    ("theta", "expected"),
    [
        ([1.0], True),
        ([0.5, 0.5], True),
        ([0.0, 1.0], False),
        ([2.5, -1.5], False),
        ([2.0, -1.0], False),
        ([*[0.0] * 14, 1.0], False),
        (feedback(1.0, 0.9, -0.9), True),
        (feedback(1.0, 1.0 - 2 * MARGIN), True),
        (feedback(1.0, 1.0 - MARGIN / 2), False),
        (feedback(1.0, 0.6 + 0.79j, 0.6 - 0.79j), True),
        (feedback(1.0, 0.6 + 0.8j, 0.6 - 0.8j), False),
    ],
)
def test_one_is_a_single_root_and_the_others_lie_inside_the_unit_circle(theta, expected):
    assert converges(np.asarray(theta, float)) is expected


def test_feedback_of_other_terms_is_not_judged():
    assert converges(np.array([0.0, 0.4]))
    assert converges(np.empty(0))


def test_the_recursion_agrees_with_eigenvalues():
    rng = np.random.default_rng(51)
    verdicts = []
    for _ in range(2000):
        theta = rng.normal(size=rng.integers(1, 16)) * rng.choice([0.1, 0.3, 1.0])
        theta[rng.random(theta.size) < 0.3] = 0.0
        theta[rng.integers(theta.size)] += 1.0 - theta.sum()
        roots = np.roots([1.0, *-theta])
        others = np.delete(roots, np.argmin(abs(roots - 1.0)))
        largest = abs(others).max(initial=0.0)
        if abs(largest - 1.0) < 1e-4:  # a multiple root of the companion matrix has errors of this size
            continue
        verdicts.append(converges(theta))
        assert verdicts[-1] is bool(largest < 1.0 - MARGIN)
    assert min(verdicts.count(True), verdicts.count(False)) > 300
