r"""Whether a residual still holds something that a better model could predict.

The five correlation tests of Billings & Voon, "Correlation based model validity tests for non-linear models",
Int. J. Control 44 (1986) 235-244 (also chapter 5 of Billings, "Nonlinear System Identification", Wiley 2013),
and the whiteness statistic of Ljung & Box, Biometrika 65 (1978) 297-303.

The residual ``xi`` of a model that has caught everything is white and independent of the inputs. Then, for
each input ``u`` and with a prime for "mean removed"::

    name      correlation                               is 0 for     what shows in it
    xi_xi     E[xi(k - tau) xi(k)]                      tau >= 1     terms in y, coloured noise
    u_xi      E[u(k - tau) xi(k)]                       every tau    linear and other odd terms in u
    xi_xiu    E[xi(k - 1 - tau) u(k - 1 - tau) xi(k)]   tau >= 0     products of noise and input
    u2_xi     E[(u^2)'(k - tau) xi(k)]                  every tau    even terms in u
    u2_xi2    E[(u^2)'(k - tau) (xi^2)'(k)]             every tau    strong terms in u, noise grown with u

A positive lag pairs a past input with the present residual.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtri

from islands.errors import SettingsError

FALSE_ALARM = 0.05
"""Share of true models that the whole set of tests may turn down; as measured, see `residual_tests`."""

_CONSTANT = 1e-9  # a signal whose rms is a smaller share of its peak than this has only rounding to show


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationTest:
    r"""One normalised correlation function of the residual, and the verdict on it.

    Attributes
    ----------
    name : str
        ``"xi_xi"``, ``"u_xi"``, ``"xi_xiu"``, ``"u2_xi"`` or ``"u2_xi2"``.
    input : int or None
        Index of the input, from 0; None for ``xi_xi``.
    lags : ndarray of int, shape (lags,)
        The lags ``tau`` in samples.
    values : ndarray, shape (lags,)
        The correlation function, between -1 and 1.
    band : float
        ``1.96 / sqrt(N)``: for a true model each single value lies within +-band with a probability of 95 %.
    limit : float
        The wider bound that decides: for a true model *all* values lie within +-limit, except at the
        false-alarm rate of this test.
    inside_percent : float
        Share of the lags inside the band, in per cent; for a true model about 95. Lag 0 of ``xi_xi``, where
        the value is 1, does not count.
    passed : bool
        No lag that counts lies outside the limit.
    label : str
        The function's name for a figure, in LaTeX: ``$\phi_{u\xi}(\tau)$``.
    note : str
        Why there was nothing to correlate (all values are 0 and the test passes), else ``""``.
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


@dataclass(frozen=True, slots=True, eq=False)
class ResidualTests:
    """The correlation tests of one residual and its whiteness.

    Attributes
    ----------
    tests : tuple of CorrelationTest
        ``xi_xi`` first, then the four tests of each input in turn.
    whiteness_p : float
        Probability that white noise has a Ljung-Box statistic at least this large.
    ljung_box : float
        ``Q = N (N + 2) sum_k r(k)^2 / (N - k)`` over the lags ``k = 1 .. max_lag`` of ``xi_xi``.
    passed : bool
        Every test passed and ``whiteness_p`` is not below their false-alarm rate.
    """

    tests: tuple[CorrelationTest, ...]
    whiteness_p: float
    ljung_box: float
    passed: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Signal:
    """A signal with its mean removed and a sum of squares of 1, or of zeros where it is constant."""

    values: NDArray[np.float64]
    called: str


def residual_tests(residual: NDArray[np.float64], u: NDArray[np.float64], max_lag: int = 25) -> ResidualTests:
    """Test a residual for what the model left in it.

    Give one-step-ahead residuals: those of a free run are coloured even for the true model, unless all noise
    is white noise on the measured output. Means are removed from every signal, from ``u`` and ``xi`` also
    before they are squared or multiplied: the tests are derived for zero means, and a bias is a matter for
    the metrics.

    The largest value decides whether a test passes: it has to stay inside a limit that holds for all lags at
    once (Sidak, J. Am. Statist. Assoc. 62 (1967) 626-633). That limit keeps its level where the lags are
    independent and is on the safe side for any dependence between them. The number of lags outside the 95 %
    band would be no verdict: a forgotten term may stand at one lag alone, and a slow input makes neighbouring
    lags leave the band together.

    All tests and the whiteness have one level, such that together they turn down a true model in about
    `FALSE_ALARM` of the cases. Measured with normal noise and one input, from 1 000 samples on: 5 to 7 % for
    a white input, 2 to 4 % for a slow one or a sine. With 200 samples of a normal white input it is 8 %,
    since the fourth-order sums of ``u2_xi2`` are not normal yet. An output-error model needs no white
    residual: leave ``xi_xi`` and ``whiteness_p`` aside and read the others, whose limits are then right only
    for a white input.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        ``y - yhat``. A leading run of NaN (warm-up) is dropped together with the rows of ``u``.
    u : ndarray, shape (samples, inputs)
        The inputs at the same samples.
    max_lag : int
        Largest lag in samples, at least 1.

    Raises
    ------
    SettingsError
        The shapes do not fit, ``max_lag`` is under 1 or leaves too few samples, or a value is not finite
        (NaN after the warm-up included).
    """
    xi, inputs = _after_warm_up(
        np.asarray(residual, dtype=np.float64), np.asarray(u, dtype=np.float64), max_lag
    )
    count = 2 + 4 * inputs.shape[1]
    level = 1.0 - (1.0 - FALSE_ALARM) ** (1.0 / count)
    noise = _signal(xi, "the residual")
    tests = [_test("xi_xi", None, noise, noise, np.arange(max_lag + 1), level, r"\xi\xi")]
    for index in range(inputs.shape[1]):
        tests += _input_tests(noise, inputs[:, index], index, inputs.shape[1], max_lag, level)
    ljung_box = _ljung_box(tests[0].values[1:], len(xi))
    whiteness_p = float(chdtrc(max_lag, ljung_box))
    return ResidualTests(
        tests=tuple(tests),
        whiteness_p=whiteness_p,
        ljung_box=ljung_box,
        passed=all(test.passed for test in tests) and whiteness_p >= level,
    )


def _after_warm_up(
    residual: NDArray[np.float64], u: NDArray[np.float64], max_lag: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if residual.ndim != 1 or u.ndim != 2 or len(residual) != len(u):
        raise SettingsError(
            "a residual is a (samples,) array, its inputs a (samples, inputs) array of the same length; "
            f"got {residual.shape} and {u.shape}"
        )
    if max_lag < 1:
        raise SettingsError(f"the largest lag is at least 1 sample, got {max_lag}")
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
            "dropped as warm-up; test recordings with gaps or warm-ups of their own one by one"
        )
    if not np.isfinite(inputs).all():
        sample, channel = np.argwhere(~np.isfinite(inputs))[0]
        raise SettingsError(
            f"input {channel} is not finite at sample {first + sample}: repair or cut the record"
        )
    return xi, inputs


def _signal(values: NDArray[np.float64], called: str) -> _Signal:
    peak = float(np.abs(values).max())
    if peak > 0.0:
        # Scaled before anything is squared, so that no unit of measurement can overflow or underflow.
        scaled = values / peak
        scaled -= scaled.mean()
        size = math.sqrt(np.add.reduce(scaled * scaled))
        if size > _CONSTANT * math.sqrt(len(values)):
            return _Signal(scaled / size, called)
    return _Signal(np.zeros_like(values), called)


def _input_tests(
    noise: _Signal, u: NDArray[np.float64], index: int, inputs: int, max_lag: int, level: float
) -> list[CorrelationTest]:
    called = f"input {index}"
    source = _signal(u, called)
    power = _signal(source.values**2, f"the square of {called}")
    noise_power = _signal(noise.values**2, "the square of the residual")
    # One sample late: xi(k-1-tau) u(k-1-tau), which the noise at k cannot know yet, stands at lag tau.
    product = _signal(noise.values * source.values, f"the residual times {called}")
    late = _Signal(np.concatenate(([0.0], product.values[:-1])), product.called)
    both, ahead = np.arange(-max_lag, max_lag + 1), np.arange(max_lag + 1)
    symbol = "u" if inputs == 1 else f"u_{{{index + 1}}}"
    square = "u^2" if inputs == 1 else f"u_{{{index + 1}}}^2"
    return [
        _test("u_xi", index, source, noise, both, level, rf"{symbol}\xi"),
        _test("xi_xiu", index, late, noise, ahead, level, rf"\xi(\xi {symbol})"),
        _test("u2_xi", index, power, noise, both, level, rf"({square})'\xi"),
        _test("u2_xi2", index, power, noise_power, both, level, rf"({square})'\xi^2"),
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
    values = _correlation(past.values, present.values, lags)
    # A signal's correlation with itself is 1 at lag 0, whatever the model: it says nothing.
    counted = np.abs(values[1:] if past is present else values)
    one_lag = 1.0 - (1.0 - level) ** (1.0 / len(counted))
    limit = -float(ndtri(one_lag / 2.0)) / math.sqrt(len(past.values))
    band = 1.96 / math.sqrt(len(past.values))
    constant = [signal.called for signal in (past, present) if not signal.values.any()]
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


def _correlation(
    past: NDArray[np.float64], present: NDArray[np.float64], lags: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return ``sum_k past(k - tau) present(k)`` at every lag."""
    samples = len(past)
    values = np.empty(len(lags))
    for row, lag in enumerate(lags.tolist()):
        ahead, behind = max(lag, 0), max(-lag, 0)
        # Not a dot product: the bits of a BLAS call depend on the number of its threads.
        values[row] = np.add.reduce(past[behind : samples - ahead] * present[ahead : samples - behind])
    return values


def _ljung_box(correlation: NDArray[np.float64], samples: int) -> float:
    lags = np.arange(1, len(correlation) + 1)
    return float(samples * (samples + 2) * np.add.reduce(correlation**2 / (samples - lags)))
