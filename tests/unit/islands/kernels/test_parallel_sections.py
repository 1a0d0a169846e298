import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import lfilter

from islands.kernels.parallel_sections import BLOCK, factor_sections, solve_rows, weigh_past

SECTIONS = np.array([[-1.5, 0.8], [-0.9, 0.0], [-1.0, 0.0]])  # the last one is an integrator
SIZES = np.array([2, 1, 1])
ENDS = np.array([BLOCK + 17, 3 * BLOCK])
DELAYS, LEADS = np.array([2, 0]), np.array([True, False])
NOISE = np.array([[0.5, -0.2], [0.6, 0.1]])
BEFORE = np.array([[0.3, -1.0], [2.0, 0.7]])


@pytest.fixture
def record():
    random = np.random.default_rng(1)
    return random.normal(size=(2, ENDS[-1])), random.normal(size=ENDS[-1])


def respond(section, size, x):
    """Return the quotient one sample before and the difference to the one before, by another filter."""
    late = lfilter([0.0, 1.0], [1.0, *section], x)
    return [late, np.diff(late, prepend=0.0)][:size]


def make_columns(u, sections, skipped, begin, end):
    """Return the responses to initial states and the columns of the coefficients of one recording."""
    samples = end - begin - skipped
    pulse = np.eye(1, samples + 1)[0]
    free = [c[1:] for each in zip(sections, SIZES, strict=True) for c in respond(*each, pulse)]
    columns = []
    for place, delay in enumerate(DELAYS):
        late = np.r_[np.full(delay, BEFORE[int(begin > 0), place]), u[place, begin : end - delay]]
        columns += [c for each in zip(sections, SIZES, strict=True) for c in respond(*each, late)]
        columns += [late] if LEADS[place] else []
    columns.append(np.arange(end - begin) / u.shape[1])
    return np.array(free), np.array(columns)[:, skipped:]


def factor(u, y, skipped, coefficients, starts, derivatives=False):
    size = coefficients.size + derivatives * (NOISE.size + 3) + 1
    residual, found = np.zeros(y.size), np.zeros((size, size))
    own = np.zeros((2, 6, 6 + size))
    factor_sections(
        *(u, y, ENDS, BEFORE, skipped, SECTIONS, SIZES, 1, DELAYS, LEADS, NOISE),
        *(coefficients, starts, derivatives, residual, found, own),
    )
    return residual, found, own


def whiten(rows, noise=NOISE):
    return lfilter(np.r_[1.0, -noise[0]], np.r_[1.0, noise[1]], rows)


def find_covariance(noise):
    """Return the stationary covariance of the states of noise with a variance of 1."""
    a, gain = np.eye(noise.shape[1], k=1), noise.sum(axis=0)
    a[:, :1] = noise[0][:, None]
    return solve_discrete_lyapunov(a, np.outer(gain, gain))


def make_rows(error, free, columns, poles, past):
    """Return equations as columns: the initial states, the columns, the derivatives, and the error."""
    pulses = lfilter([1.0], np.r_[1.0, NOISE[1]], np.eye(2, error.size))

    def find_innovations(noise):
        """Return the white noise for given states of the noise before the recording."""
        return whiten(error, noise) - lfilter([1.0], np.r_[1.0, noise[1]], past @ np.eye(2, error.size))

    noises = []
    for place in np.ndindex(NOISE.shape):
        change = np.zeros_like(NOISE)
        change[place] = 1e-6
        noises.append((find_innovations(NOISE - change) - find_innovations(NOISE + change)) / 2e-6)
    rows = np.vstack([pulses, whiten(free), whiten(columns), noises, whiten(poles), whiten(error)])
    before = np.zeros((len(rows), 2))
    before[:2] = np.linalg.cholesky(np.linalg.inv(find_covariance(NOISE)))
    return np.hstack([before, rows])


@pytest.mark.parametrize("skipped", [0, 2])
def test_factor_has_the_products_of_whitened_derivatives_without_the_initial_states(record, skipped):
    u, y = record
    random = np.random.default_rng(2)
    coefficients, starts = random.normal(size=10), random.normal(size=(2, 6))
    residual, found, _ = factor(u, y, skipped, coefficients, starts, True)
    products = np.zeros_like(found)
    for begin, end, start in zip([0, ENDS[0]], ENDS, starts, strict=True):

        def find_error(sections, begin=begin, end=end, start=start):
            free, columns = make_columns(u, sections, skipped, begin, end)
            return y[begin + skipped : end] - coefficients @ columns - start[2:] @ free

        error = find_error(SECTIONS)
        np.testing.assert_allclose(residual[begin + skipped : end], error, atol=1e-9)
        poles = []
        # The coordinates of two coefficients are a1 + a2 and -a2.
        for row, change in ((0, [1.0, 0.0]), (0, [1.0, -1.0]), (1, [1.0, 0.0])):
            step = np.zeros_like(SECTIONS)
            step[row] = 1e-6 * np.array(change)
            poles.append((find_error(SECTIONS - step) - find_error(SECTIONS + step)) / 2e-6)
        rows = make_rows(error, *make_columns(u, SECTIONS, skipped, begin, end), np.array(poles), start[:2])
        basis = np.linalg.qr(rows[:6].T)[0]
        rows = rows[6:] - (rows[6:] @ basis) @ basis.T
        products += rows @ rows.T
    units = np.sqrt(np.outer(np.diag(products), np.diag(products)))
    np.testing.assert_allclose(found.T @ found / units, products / units, atol=1e-6)


def test_rows_of_initial_states_have_the_states_of_a_recording(record):
    u, _ = record
    random = np.random.default_rng(3)
    coefficients, starts = random.normal(size=10), random.normal(size=(2, 6))
    starts[:, :2] = 0.0
    y = -factor(u, np.zeros(u.shape[1]), 0, coefficients, starts)[0]
    _, found, own = factor(u, y, 0, np.zeros(10), np.zeros((2, 6)))
    np.testing.assert_allclose(np.linalg.solve(found[:10, :10], found[:10, 10]), coefficients, 1e-6)
    for rows, start in zip(own, starts, strict=True):
        moment = rows[:, -1] - rows[:, 6:-1] @ coefficients
        np.testing.assert_allclose(np.linalg.solve(rows[:, :6], moment), start, 1e-6, atol=1e-7)


@pytest.mark.ci  # compiles the kernel, which only others call
@pytest.mark.parametrize("noise", [NOISE, np.array([[0.99], [-0.2]]), np.zeros((2, 0))])
def test_states_of_noise_are_weighed_by_their_stationary_covariance(noise):
    weights = weigh_past(noise)
    if noise.size:
        np.testing.assert_allclose(weights.T @ weights, np.linalg.inv(find_covariance(noise)), 1e-6)
    assert (np.tril(weights, -1) == 0.0).all()


@pytest.mark.ci
def test_noise_without_a_variance_has_free_states():
    assert (weigh_past(np.array([[1.2, -0.1], [0.3, 0.0]])) == 0.0).all()


def test_equations_are_solved_with_the_least_squares():
    random = np.random.default_rng(4)
    a, b = random.normal(size=(9, 4)), random.normal(size=9)
    solution = np.empty(4)
    left = solve_rows(np.column_stack([a, b]), np.linalg.norm(a, axis=0), 1e-10, solution)
    exact, squares, *_ = np.linalg.lstsq(a, b)
    np.testing.assert_allclose(solution, exact)
    assert left == pytest.approx(squares[0])


def test_column_that_depends_on_those_before_has_the_value_zero():
    random = np.random.default_rng(5)
    a, b = random.normal(size=(9, 4)), random.normal(size=9)
    a[:, 2] = a[:, 0] - 3.0 * a[:, 1]
    solution = np.empty(4)
    left = solve_rows(np.column_stack([a, b]), np.linalg.norm(a, axis=0), 1e-10, solution)
    exact, squares, *_ = np.linalg.lstsq(a[:, [0, 1, 3]], b)
    np.testing.assert_allclose(solution, np.insert(exact, 2, 0.0))
    assert left == pytest.approx(squares[0])
