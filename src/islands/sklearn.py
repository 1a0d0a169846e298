"""An estimator of scikit-learn for sequences (extra ``sklearn``): rows are consecutive samples.

>>> from islands.sklearn import IslandsRegressor
>>> regressor = IslandsRegressor(dt=0.01, max_terms=5).fit(X, y)  # doctest: +SKIP
>>> regressor.predict(X_next)  # doctest: +SKIP
"""

from collections.abc import Mapping
from math import inf
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.distribution import describe_missing_extra
from islands.errors import IslandsError, SettingsError, suggest
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.models.candidate_library import LIBRARIES, get_library
from islands.models.narx import Model
from islands.records.averaging import AUTO
from islands.records.dataset import Dataset
from islands.records.masked_values import fill_masked
from islands.simulation.predictors import free_run

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.utils import check_random_state
    from sklearn.utils.validation import check_array, check_is_fitted, validate_data
except ImportError as missing:
    raise SettingsError(describe_missing_extra("IslandsRegressor", "sklearn")) from missing

#: Where a prediction starts, as values of the parameter ``start``.
STARTS = ("end", "begin")

#: Samples of the validation data after the largest lag that the residual tests need.
_RESIDUALS = 4


class IslandsRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Difference equation of one output and several inputs, as a regressor of scikit-learn.

    The rows of X and y are consecutive samples of one recording, so they have to stay in order: take
    ``TimeSeriesSplit`` for cross-validation, and no shuffling. A prediction is a free run: it uses past
    predictions in place of measured outputs, which `predict` does not have.

    Parameters
    ----------
    dt : float
        Sampling time in seconds. It scales nothing; models state it.
    method : str
        ``fit`` (subset selection over a library, fast) or ``identify`` (evolution).
    library : str
        Candidate library of ``fit``: ``auto`` fits several and takes the best one; ``polynomial`` is for
        smooth systems, ``phi-polynomial`` for hysteresis.
    degree, lags : int, optional
        Degree and lags of the library of ``fit``; None takes the defaults of the library.
    preset : str
        Preset of ``identify``; ``auto`` chooses it.
    max_terms : int
        Size of the largest model.
    constraints : str, optional
        Constraints on the parameters, such as ``gain = 2.5``; None takes those of the library or preset.
    feedthrough : str
        Whether models read inputs at sample k: ``auto`` (test the data), ``yes`` or ``no``.
    validation : float
        Fraction at the end of the training data that chooses the model; of very short data up to a half.
    start : str
        State in which a prediction starts: ``end`` continues the training data, as the folds of
        ``TimeSeriesSplit`` do; ``begin`` starts from the first samples of the training data, for a recording
        that starts from the same state.
    settings : mapping, optional
        Further settings of `islands.fit` or of `islands.identify`, such as ``{"generations": 20}``.
    random_state : int, RandomState or None
        Seed of the search. An integer gives the same model every time.

    Attributes
    ----------
    result_ : Result
        All models of the search, ranked.
    model_ : Model
        Recommended model.
    equation_ : str
        Its equation.
    n_features_in_ : int
    feature_names_in_ : ndarray of str
        Only if X has string column names; they are the names of the inputs in the equation.
    """

    def __init__(
        self,
        dt: float = 1.0,
        *,
        method: str = "fit",
        library: str = AUTO,
        degree: int | None = None,
        lags: int | None = None,
        preset: str = AUTO,
        max_terms: int = 10,
        constraints: str | None = None,
        feedthrough: str = "auto",
        validation: float = 0.25,
        start: str = "end",
        settings: Mapping[str, Any] | None = None,
        random_state: Any = 0,
    ) -> None:
        self.dt = dt
        self.method = method
        self.library = library
        self.degree = degree
        self.lags = lags
        self.preset = preset
        self.max_terms = max_terms
        self.constraints = constraints
        self.feedthrough = feedthrough
        self.validation = validation
        self.start = start
        self.settings = settings
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Find models of the output.

        Parameters
        ----------
        X : array_like, shape (samples, inputs)
            Inputs of consecutive samples.
        y : array_like, shape (samples,)
            Output.

        Raises
        ------
        ValueError
            The data or a parameter cannot be used.
        """
        u, output = validate_data(
            self,
            fill_masked(X),
            fill_masked(y),
            dtype=np.float64,
            y_numeric=True,
            ensure_min_samples=2,
            estimator=self,
        )
        if self.start not in STARTS:
            raise ValueError(
                f"start is one of {', '.join(STARTS)}, got {self.start!r}{suggest(self.start, STARTS)}"
            )
        names = tuple(getattr(self, "feature_names_in_", [f"x{place + 1}" for place in range(u.shape[1])]))
        try:
            record = Dataset(u, output, self.dt, names, _name_output(names))
            result = self._search(record, int(check_random_state(self.random_state).randint(2**31)))
        except IslandsError as error:
            raise ValueError(str(error)) from error
        self.result_ = result
        self.model_: Model = result.best.model
        self.equation_ = result.best.equation
        lag = max(1, self.model_.maximum_lag)
        first = slice(-lag, None) if self.start == "end" else slice(lag)
        self._state = u[first].copy(), np.asarray(output, dtype=np.float64)[first].copy()
        return self

    def predict(self, X: ArrayLike, initial: ArrayLike | None = None) -> NDArray[np.float64]:
        """Simulate the output.

        Parameters
        ----------
        X : array_like, shape (samples, inputs)
            Inputs of consecutive samples.
        initial : array_like, optional
            Measured outputs of the first samples of X, at least the largest lag of the model, from which the
            simulation starts, in place of the state that ``start`` names.

        Returns
        -------
        ndarray, shape (samples,)
            NaN after a divergence. The first samples are those of ``initial``, if it is given.

        Raises
        ------
        ValueError
            X or ``initial`` cannot be used.
        """
        check_is_fitted(self)
        u = validate_data(self, fill_masked(X), dtype=np.float64, reset=False)
        lag = self.model_.maximum_lag
        if initial is None:
            before, known = self._state
        else:
            known = check_array(
                fill_masked(initial), ensure_2d=False, dtype=np.float64, input_name="initial"
            ).ravel()
            if not lag <= len(known) <= len(u):
                raise ValueError(f"initial has from {lag} to {len(u)} outputs, got {len(known)}")
            before = u[:0]
        whole = np.vstack([before, u])
        output = np.full(len(whole), np.nan)
        output[: len(known)] = known
        record = Dataset(whole, output, self.dt, self.model_.column_names, self.model_.output_name)
        scale = float(np.abs(self._state[1]).max()) + self.result_.search_result.record.output_range
        if len(whole) > len(known):
            run = free_run(self.model_, record, max(lag, len(known)), bound=1e6 * (scale or 1.0))
            output[len(known) :] = run.y[len(known) :]
        return output[len(before) :]

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Return R2 of the simulation; -inf if it diverges."""
        if np.isnan(self.predict(X)).any():
            return -inf
        return float(super().score(X, fill_masked(y), sample_weight))

    def _search(self, record: Dataset, seed: int) -> Any:
        further = dict(self.settings or {})
        common: dict[str, Any] = {
            "validation": self.validation,
            "feedthrough": self.feedthrough,
            "max_terms": self.max_terms,
        }
        if self.constraints is not None:
            common["constraints"] = self.constraints
        # Means of samples would have fewer rows than X.
        common |= {"average": 1, "seed": seed}
        if self.method == "fit":
            library: dict[str, Any] = {"library": self.library, "degree": self.degree, "lags": self.lags}
            libraries = LIBRARIES if self.library == AUTO else [self.library]
            lags = max(get_library(each).lags for each in libraries) if self.lags is None else self.lags
            enough = min(0.5, (lags + _RESIDUALS) / record.samples)
            common["validation"] = max(self.validation, enough)
            return fit(record, **common, **library, **further)
        if self.method == "identify":
            return identify(record, **common, preset=self.preset, **further)
        raise SettingsError(f"method is fit or identify, got {self.method!r}")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # The rows of the data sets of scikit-learn's checks are independent.
        tags.regressor_tags.poor_score = True
        return tags


def _name_output(names: tuple[str, ...]) -> str:
    return next(name for name in ("y", "output", "output_of_islands") if name not in names)
