"""The estimator of scikit-learn."""

import pickle

import numpy as np
import pandas as pd
import pytest

import islands

pytestmark = pytest.mark.ci

DT = 0.1

#: Checks of scikit-learn that contradict sequences, with the reason.
CONTRADICTIONS = {
    "check_methods_sample_order_invariance": "rows are consecutive samples: their order is the time",
    "check_methods_subset_invariance": "a row is predicted from the rows before it",
    "check_estimators_nan_inf": "its training output is constant, which determines no difference equation",
}


def simulate(u, start=0.0):
    """Return y(k) = 0.8 y(k-1) + 0.4 u(k-1) + 0.1 u(k-1)^2."""
    y = np.full(len(u), start)
    for k in range(1, len(u)):
        y[k] = 0.8 * y[k - 1] + 0.4 * u[k - 1] + 0.1 * u[k - 1] ** 2
    return y


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-1.0, 1.0, 120), 5)
    return u[:, None], simulate(u)


@pytest.fixture
def regressor():
    from islands.sklearn import IslandsRegressor

    return IslandsRegressor(
        DT, library="polynomial", degree=2, lags=1, max_terms=4, settings={"certificate": 0}
    )


@pytest.mark.parametrize("library", ["polynomial", pytest.param("auto", marks=pytest.mark.nightly)])
def test_the_checks_of_scikit_learn_pass(library):
    from sklearn.utils.estimator_checks import check_estimator

    from islands.sklearn import IslandsRegressor

    small = IslandsRegressor(library=library, lags=1, degree=1, max_terms=2, settings={"certificate": 0})
    checks = check_estimator(small, expected_failed_checks=CONTRADICTIONS, on_fail=None, on_skip=None)
    by_status = {check["check_name"]: check["status"] for check in checks if check["status"] != "passed"}
    assert {name for name, status in by_status.items() if status == "xfail"} == set(CONTRADICTIONS)
    assert "failed" not in by_status.values(), by_status


def test_a_prediction_continues_the_training_data(data, regressor):
    u, y = data
    regressor.fit(u[:400], y[:400])
    assert regressor.predict(u[400:]) == pytest.approx(y[400:], abs=1e-6)
    assert regressor.score(u[400:], y[400:]) > 0.999999
    assert regressor.equation_ == regressor.result_.best.equation
    assert {item.text for item in regressor.model_.regressors} == {"y(k-1)", "u1(k-1)", "u1(k-1)^2"}


def test_a_prediction_starts_from_the_begin_or_from_given_outputs(data, regressor):
    u, y = data
    regressor.set_params(start="begin").fit(u, y)
    assert regressor.predict(u[1:]) == pytest.approx(y[1:], abs=1e-6)
    other = simulate(u[:, 0], start=3.0)
    assert regressor.predict(u, initial=other[:1]) == pytest.approx(other, abs=1e-6)
    assert regressor.predict(u[:1], initial=other[:1]).tolist() == [3.0]
    with pytest.raises(ValueError, match="initial has from 1 to 600 outputs, got 601"):
        regressor.predict(u, initial=np.zeros(601))


@pytest.mark.nightly
def test_a_pipeline_and_a_grid_search_take_the_regressor(data, regressor):
    from sklearn.model_selection import GridSearchCV, TimeSeriesSplit
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    u, y = data
    pipeline = make_pipeline(StandardScaler(), regressor)
    grid = {"islandsregressor__degree": [1, 2]}
    search = GridSearchCV(pipeline, grid, cv=TimeSeriesSplit(3)).fit(u, y)
    assert search.best_params_ == {"islandsregressor__degree": 2}
    assert search.best_score_ > 0.999


def test_columns_of_a_frame_name_the_inputs(data, regressor):
    u, y = data
    frame = pd.DataFrame({"pump_V": u[:, 0]})
    regressor.fit(frame, pd.Series(y))
    assert regressor.model_.input_names == ("pump_V",)
    assert regressor.feature_names_in_.tolist() == ["pump_V"]
    copy = pickle.loads(pickle.dumps(regressor))
    assert np.array_equal(copy.predict(frame), regressor.predict(frame))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"method": "guess"}, "fit or identify"),
        ({"start": "middle"}, "end, begin"),
        ({"dt": 0.0}, "positive"),
    ],
)
def test_wrong_parameters_are_value_errors(data, regressor, changes, message):
    u, y = data
    with pytest.raises(ValueError, match=message):
        regressor.set_params(**changes).fit(u, y)


def test_a_diverging_prediction_has_the_worst_score(data, regressor):
    u, y = data
    regressor.fit(u, y)
    growing = islands.make_model([(islands.parse("y(k-1)"), 2.0), (islands.parse("u(k-1)"), 1.0)], ("x1",))
    regressor.model_ = growing
    assert regressor.score(u, y) == -np.inf
