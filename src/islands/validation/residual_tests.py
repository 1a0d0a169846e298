r"""Tests of whether a residual contains predictable structure.

The tests are the five correlation tests of Billings & Voon, "Correlation based model validity tests for
non-linear models", Int. J. Control 44 (1986) 235-244 (also chapter 5 of Billings, "Nonlinear System
Identification", Wiley 2013), and the whiteness statistic of Ljung & Box, Biometrika 65 (1978) 297-303.

The residual ``xi`` of a complete model is white and independent of the inputs. Then, for each input ``u``,
and with a prime for "mean removed"::

    name      correlation                               is 0 for     detects
    xi_xi     E[xi(k - tau) xi(k)]                      tau >= 1     terms in y, coloured noise
    u_xi      E[u(k - tau) xi(k)]                       every tau    linear and other odd terms in u
    xi_xiu    E[xi(k - 1 - tau) u(k - 1 - tau) xi(k)]   tau >= 0     products of noise and input
    u2_xi     E[(u^2)'(k - tau) xi(k)]                  every tau    even terms in u
    u2_xi2    E[(u^2)'(k - tau) (xi^2)'(k)]             every tau    strong terms in u, noise growing with u

A positive lag correlates a past input with the present residual.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.rounding import ROUNDING

#: Nominal probability that the set of tests rejects a true model. `residual_tests` gives measured rates.
FALSE_ALARM = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationTest:
    r"""One normalised correlation function of the residual and its test result.

    Attributes
    ----------
    name : str
        ``"xi_xi"``, ``"u_xi"``, ``"xi_xiu"``, ``"u2_xi"`` or ``"u2_xi2"``.
    input : int or None
        Index of the input, from 0. None for ``xi_xi``.
    lags : ndarray of int, shape (lags,)
        The lags ``tau`` in samples.
    values : ndarray, shape (lags,)
        The correlation function, between -1 and 1.
    band : float
        ``1.96 / sqrt(N)``: for a true model each single value is within +-band with a probability of 95 %.
    limit : float
        Limit of the test: for a true model *all* values are within +-limit, except at the false-alarm rate of
        this test.
    inside_percent : float
        Fraction of the lags inside the band, in per cent; about 95 for a true model. Lag 0 of ``xi_xi``, at
        which the value is 1, does not count.
    passed : bool
        Whether all counted lags are within the limit.
    label : str
        Name of the function for a figure, in LaTeX: ``$\phi_{u\xi}(\tau)$``.
    note : str
        Reason why there is nothing to correlate; all values are then 0 and the test passes. In an
        `Assessment` also the reason of a divergence; the test then fails. Empty otherwise.
    """

    name: str
    input: int | None
    lags: NDArray[np.int64]
    values: NDArray[np.float64]
    band: float
    limit: float
    inside_percent: float
    passed: bool
    label: str
    note: str = ""

    @property
    def probability(self) -> float:
        """Probability that a true model has a value at least as large at one of the counted lags."""
        samples = (1.96 / self.band) ** 2
        counted = self.values[1:] if self.name == "xi_xi" else self.values
        one_lag = 2.0 * float(scipy.special.ndtr(-math.sqrt(samples) * np.abs(counted).max()))
        return join_probabilities(one_lag, len(counted))


@dataclass(frozen=True, slots=True, eq=False)
class ResidualTests:
    """The correlation tests and the whiteness test of one residual.

    Attributes
    ----------
    tests : tuple of CorrelationTest
        ``xi_xi``, followed by the four tests of each input.
    whiteness_p : float
        Probability that white noise has a Ljung-Box statistic at least this large.
    ljung_box : float
        ``Q = N (N + 2) sum_k r(k)^2 / (N - k)`` over the lags ``k = 1 .. max_lag`` of ``xi_xi``.
    passed : bool
        Whether every test passed and ``whiteness_p`` is not below the false-alarm rate of a single test.
    """

    tests: tuple[CorrelationTest, ...]
    whiteness_p: float
    ljung_box: float
    passed: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Signal:
    """A named signal without its mean and with a sum of squares of 1, or of zeros if it is constant."""

    values: NDArray[np.float64]
    name: str


def join_probabilities(least: float, count: int) -> float:
    """Return the probability that the least of independent probabilities is at most the given one (Sidak)."""
    return 1.0 if least >= 1.0 else -math.expm1(count * math.log1p(-least))


def residual_tests(residual: NDArray[np.float64], u: NDArray[np.float64], max_lag: int = 25) -> ResidualTests:
    """Test a residual for structure that the model does not explain.

    Use one-step-ahead residuals. Residuals of a free run are coloured even for the true model, unless all
    noise is white measurement noise. The mean of every signal is removed, and that of ``u`` and ``xi`` also
    before they are squared or multiplied, because the tests are derived for zero means. The error metrics
    show a bias.

    A test passes if its largest value is within a limit for all lags simultaneously (Sidak, J. Am. Statist.
    Assoc. 62 (1967) 626-633). The limit has the nominal level for independent lags and is conservative for
    dependent lags. The number of lags outside the 95 % band is not a suitable criterion: a missing term may
    appear at a single lag, and a slow input makes adjacent lags leave the band together.

    All tests, including whiteness, have the same level. Together they reject a true model in about
    `FALSE_ALARM` of the cases. Rates measured with normal noise and one input, from 1 000 samples on: 5 to
    7 % for a white input, 2 to 4 % for a slow input or a sine. With 200 samples of a normal white input the
    rate is 8 %, because the fourth-order sums of ``u2_xi2`` are not yet normally distributed. The residual of
    an output-error model need not be white: ignore ``xi_xi`` and ``whiteness_p``. The limits of the other
    tests are then only valid for a white input.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        ``y - yhat``. Leading NaN (warm-up) are dropped together with the same rows of ``u``.
    u : ndarray, shape (samples, inputs)
        Inputs at the same samples.
    max_lag : int
        Largest lag in samples, at least 1.

    Raises
    ------
    SettingsError
        The shapes are inconsistent, ``max_lag`` is less than 1 or leaves too few samples, or a value is not
        finite (including NaN after the warm-up).
    """
    xi, inputs = _drop_warm_up(
        np.asarray(residual, dtype=np.float64), np.asarray(u, dtype=np.float64), max_lag
    )
    count = 2 + 4 * inputs.shape[1]
    level = 1.0 - (1.0 - FALSE_ALARM) ** (1.0 / count)
    noise = _normalise(xi, "the residual")
    tests = [_test("xi_xi", None, noise, noise, np.arange(max_lag + 1), level, r"\xi\xi")]
    for index in range(inputs.shape[1]):
        tests += _test_input(noise, inputs[:, index], index, inputs.shape[1], max_lag, level)
    ljung_box = _compute_ljung_box(tests[0].values[1:], len(xi))
    whiteness_p = float(scipy.special.chdtrc(max_lag, ljung_box))
    return ResidualTests(
        tests=tuple(tests),
        whiteness_p=whiteness_p,
        ljung_box=ljung_box,
        passed=all(test.passed for test in tests) and whiteness_p >= level,
    )


def _drop_warm_up(
    residual: NDArray[np.float64], u: NDArray[np.float64], max_lag: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if residual.ndim != 1 or u.ndim != 2 or len(residual) != len(u):
        raise SettingsError(
            "the residual must be a (samples,) array, the inputs a (samples, inputs) array of the same "
            f"length; got {residual.shape} and {u.shape}"
        )
    if max_lag < 1:
        raise SettingsError(f"the largest lag must be at least 1 sample, got {max_lag}")
    missing = np.isnan(residual)
    first = len(residual) if missing.all() else int(np.argmin(missing))
    xi, inputs = residual[first:], u[first:]
    if len(xi) < max_lag + 2:
        raise SettingsError(
            f"{len(xi)} residuals after the warm-up are too few for lags up to {max_lag}: "
            "take a longer record or a smaller max_lag"
        )
    if not np.isfinite(xi).all():
        sample = first + int(np.argmin(np.isfinite(xi)))
        raise SettingsError(
            f"the residual is {residual[sample]} at sample {sample}: only NaN before its first value is "
            "dropped as warm-up; test recordings with gaps or separate warm-ups one by one"
        )
    if not np.isfinite(inputs).all():
        sample, channel = np.argwhere(~np.isfinite(inputs))[0]
        raise SettingsError(
            f"input {channel} is not finite at sample {first + sample}: repair or cut the record"
        )
    return xi, inputs


def _normalise(values: NDArray[np.float64], name: str) -> _Signal:
    peak = float(np.abs(values).max())
    if peak > 0.0:
        # Scale before squaring, so that squares neither overflow nor underflow in any unit.
        scaled = values / peak
        scaled -= scaled.mean()
        size = math.sqrt(np.add.reduce(scaled * scaled))
        if size > ROUNDING * math.sqrt(len(values)):
            return _Signal(scaled / size, name)
    return _Signal(np.zeros_like(values), name)


def _test_input(
    noise: _Signal, u: NDArray[np.float64], index: int, inputs: int, max_lag: int, level: float
) -> list[CorrelationTest]:
    # Inputs are numbered from 1, as in the symbols of the tests and on the page.
    name = f"input {index + 1}"
    source = _normalise(u, name)
    power = _normalise(source.values**2, f"the square of {name}")
    noise_power = _normalise(noise.values**2, "the square of the residual")
    # Delay the product by one sample, so that lag tau correlates xi(k-1-tau) u(k-1-tau) with xi(k): white
    # noise at k is independent of that product.
    product = _normalise(noise.values * source.values, f"the residual times {name}")
    delayed = _Signal(np.concatenate(([0.0], product.values[:-1])), product.name)
    both_signs, not_negative = np.arange(-max_lag, max_lag + 1), np.arange(max_lag + 1)
    symbol = "u" if inputs == 1 else f"u_{{{index + 1}}}"
    square = "u^2" if inputs == 1 else f"u_{{{index + 1}}}^2"
    return [
        _test("u_xi", index, source, noise, both_signs, level, rf"{symbol}\xi"),
        _test("xi_xiu", index, delayed, noise, not_negative, level, rf"\xi(\xi {symbol})"),
        _test("u2_xi", index, power, noise, both_signs, level, rf"({square})'\xi"),
        _test("u2_xi2", index, power, noise_power, both_signs, level, rf"({square})'\xi^2"),
    ]


def _test(
    name: str,
    input_index: int | None,
    past: _Signal,
    present: _Signal,
    lags: NDArray[np.int64],
    level: float,
    symbols: str,
) -> CorrelationTest:
    values = _correlate(past.values, present.values, lags)
    # The autocorrelation at lag 0 is 1 for every model and does not count.
    counted = np.abs(values[1:] if past is present else values)
    one_lag = 1.0 - (1.0 - level) ** (1.0 / len(counted))
    limit = -float(scipy.special.ndtri(one_lag / 2.0)) / math.sqrt(len(past.values))
    band = 1.96 / math.sqrt(len(past.values))
    constant = [signal.name for signal in (past, present) if not signal.values.any()]
    for array in (lags, values):
        array.setflags(write=False)
    return CorrelationTest(
        name=name,
        input=input_index,
        lags=lags,
        values=values,
        band=band,
        limit=limit,
        inside_percent=100.0 * float((counted <= band).mean()),
        passed=bool((counted <= limit).all()),
        label=rf"$\phi_{{{symbols}}}(\tau)$",
        note=f"{constant[0]} is constant: there is nothing to correlate" if constant else "",
    )


def _correlate(
    past: NDArray[np.float64], present: NDArray[np.float64], lags: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return ``sum_k past(k - tau) present(k)`` at every lag."""
    samples = len(past)
    values = np.empty(len(lags))
    for row, lag in enumerate(lags.tolist()):
        ahead, behind = max(lag, 0), max(-lag, 0)
        # Not a dot product: the rounding of a BLAS call depends on the number of threads.
        values[row] = np.add.reduce(past[behind : samples - ahead] * present[ahead : samples - behind])
    return values


def _compute_ljung_box(correlation: NDArray[np.float64], samples: int) -> float:
    lags = np.arange(1, len(correlation) + 1)
    return float(samples * (samples + 2) * np.add.reduce(correlation**2 / (samples - lags)))
