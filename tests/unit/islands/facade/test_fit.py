"""`islands.fit`, and the methods of its result."""

import json
import warnings
from contextlib import nullcontext

import numpy as np
import pytest

import islands
from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import record_document, result_document, result_json
from islands.report.figures.names import ALL_FIGURES
from islands.report.text.statements import describe
from islands.simulation.predictors import free_run, multiple_shooting, one_step_ahead
from islands.validation.physics import check_physics
from support.known_records import RUNAWAY, runaway
from support.undrawn import undrawn_figures


def walk(samples, seed, inputs=1):
    return 0.1 * np.cumsum(np.random.default_rng(seed).normal(size=(samples, inputs)), axis=0)


def piezo(samples=600, seed=0, noise=0.002, **changes):
    """Return a record of hysteresis that the library phi-polynomial contains, with little noise."""
    u, y = walk(samples, seed), np.zeros(samples)
    for k in range(3, samples):
        new = u[k - 1, 0] - u[k - 2, 0]
        y[k] = y[k - 1] + 0.8 * new - 0.3 * y[k - 1] * abs(new)
    y += noise * np.random.default_rng(seed + 1).normal(size=samples)
    return Dataset(u, y, **({"dt": 0.01, "input_names": ("u_V",), "output_name": "y_um"} | changes))


def tank(samples=400, seed=0, size=1.0):
    """Return a record of a smooth first-order system."""
    rng = np.random.default_rng(seed)
    u, y = size * rng.uniform(-1, 1, samples), np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.6 * y[k - 1] + 0.5 * u[k - 1] - 0.2 * u[k - 1] ** 2 + 0.01 * rng.normal()
    return Dataset(u, y, 1.0)


def with_output(record, y):
    return Dataset(record.u, y, record.dt, record.input_names, record.output_name)


@pytest.fixture(scope="module")
def result():
    return islands.fit(piezo(), library="phi-polynomial", max_terms=5)


# Attributes and methods of a result.


def test_an_extrapolating_validation_is_a_warning_before_the_fit() -> None:
    data = tank()
    wide = Dataset(3.0 * data.u[:100], data.y[:100], data.dt)

    def refuse(*_):
        raise AssertionError("the fit began before the warning")

    message = "validation extrapolates: u is .* in the validation data and .* in the estimation data"
    with pytest.warns(islands.ExtrapolationWarning, match=message), pytest.raises(AssertionError):
        islands.fit(data, validation=wide, progress=refuse)
    with pytest.warns(islands.ExtrapolationWarning, match=message), pytest.raises(AssertionError):
        islands.identify(data, validation=wide, progress=refuse)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        within = Dataset(0.9 * data.u[:100], data.y[:100], data.dt)
        settings = {"library": "polynomial", "degree": 1, "lags": 1, "certificate": 0, "average": 1}
        islands.fit(data, validation=within, estimator="shooting", **settings)


def test_model_simulates_a_record_in_three_modes(result):
    record, model = piezo(200, seed=9), result.best.model
    shooting = result.search_result.settings["shooting"]
    assert (shooting, model.maximum_lag) == (45, 2)
    # The warm-up of the errors is the largest lag of the library.
    expected = {
        "one-step": one_step_ahead(model, record, 3).y,
        "shooting": multiple_shooting(model, record, shooting, 3).y,
        "free-run": free_run(model, record, 3).y,
    }
    for mode, y in expected.items():
        assert np.array_equal(result.best.simulate(record, mode).y, y, equal_nan=True)
    assert np.array_equal(result.best.simulate(record).y, expected["free-run"], equal_nan=True)
    assert not np.array_equal(expected["one-step"][10:], expected["shooting"][10:])
    with pytest.raises(
        SettingsError, match="unknown mode 'backwards': take one of one-step, shooting, free-run"
    ):
        result.best.simulate(record, "backwards")


def test_result_is_saved_as_a_folder(result, tmp_path):
    with undrawn_figures():
        folder = result.with_wall_time(2.0).save(tmp_path / "new" / "out")
    assert folder == tmp_path / "new" / "out"
    assert {path.name for path in folder.iterdir()} == {
        "result.json",
        "models",
        "figures",
        "summary.txt",
        "method.txt",
    }
    figures = {path.name for path in (folder / "figures").iterdir()}
    assert figures == {"free-run.svg"}
    search = json.loads((folder / "result.json").read_text())["search"]
    assert search["wall_s"] == 2.0
    assert search["evaluations_per_second"] == pytest.approx(search["evaluations"] / 2.0)
    assert result.search_result.search.wall_s is None


# Reproducibility and settings.


def test_equal_arguments_give_equal_bits(result):
    again = islands.fit(piezo(), library="phi-polynomial", max_terms=5)
    assert result_json(again.search_result) == result_json(result.search_result)
    assert [model.export("json") for model in again.models] == [
        model.export("json") for model in result.models
    ]


@pytest.mark.ci
def test_validation_record_does_not_affect_the_parameters_of_a_structure():
    whole = islands.fit(tank(), validation=tank(150, seed=5), library="polynomial", max_terms=3)
    other = islands.fit(tank(), validation=tank(150, seed=6), library="polynomial", max_terms=3)
    described = whole.search_result.settings["validation"]
    assert (described["samples"], described["sha256"]) == (150, record_document(tank(150, seed=5))["sha256"])
    assert whole.search_result.split.estimation.samples == 400
    assert whole.search_result.split.validation.samples == 150
    by_structure = [{m.model.parameter_names: m for m in made.models} for made in (whole, other)]
    common = by_structure[0].keys() & by_structure[1].keys()
    assert common
    for structure in common:
        assert by_structure[0][structure].model == by_structure[1][structure].model
        errors = [entry[structure].metrics["validation"]["free_run"].rmse for entry in by_structure]
        assert errors[0] != errors[1]


# Validation data.


def test_validation_data_need_the_same_inputs_and_sampling_time():
    record, renamed = piezo(), piezo(200, seed=1, input_names=("u_val_V",), output_name="y_val_um")
    made = islands.fit(record, library="phi-polynomial", validation=renamed, max_terms=2)
    assert made.best.model.input_names == ("u_V",)
    two = Dataset(walk(200, 0, inputs=2), piezo(200).y, 0.01)
    with pytest.raises(RecordError, match=r"has 1 inputs \(u_V\), the validation data 2 \(u1, u2\)"):
        islands.fit(record, validation=two)
    with pytest.raises(RecordError, match=r"of 0\.01 s, the validation data of 0\.02 s: resample"):
        islands.fit(record, validation=piezo(200, dt=0.02))


# Records of every kind.


@pytest.fixture(params=["undrawn", pytest.param("drawn", marks=pytest.mark.ci)])
def drawing(request):
    """Skip the rendering of figures; render them at the level ci."""
    with undrawn_figures() if request.param == "undrawn" else nullcontext():
        yield


def test_constant_output_gives_a_model_of_one_term(tmp_path, drawing):
    still = with_output(piezo(200), np.full(200, 3.0))
    made = islands.fit(still)
    assert [model.equation for model in made.models] == ["y_um(k) = y_um(k-1)"]
    assert made.best.metrics["validation"]["free_run"].rmse == 0.0
    assert made.best.physics.hold_drift_percent == 0.0
    (row,) = (line for line in str(made).splitlines() if line.strip().startswith("1*"))
    assert "-" in row.split()
    assert "nan" not in str(made)
    made.save(tmp_path, figures=ALL_FIGURES)


# Progress.


# Errors.


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"library": "wavelets"}, "library is one of auto, phi-polynomial, polynomial"),
        ({"estimator": "kalman"}, "estimator is one of least-squares, extended-"),
        ({"constraints": "passive"}, "unknown constraints 'passive': take one of none, hysteresis"),
        ({"max_terms": 0}, "max_terms is an integer of at least 1, got 0"),
        ({"degree": 0}, "degree and lags are at least 1, got 0 and 3"),
        ({"lags": 1}, "phi-polynomial needs lags of at least 2"),
        ({"library": "polynomial", "degree": 5, "lags": 11}, "80730 candidates are more than a library"),
        ({"shooting": 0}, "shooting is an integer of at least 1, got 0"),
        ({"validation": 1.0}, "the validation fraction lies between 0 and 1, got 1.0"),
        ({"validation": 0.0001}, "leaves a part empty"),
    ],
)
def test_setting_out_of_range_raises_settings_error(settings, message):
    with pytest.raises(SettingsError) as caught:
        islands.fit(piezo(), **{"library": "phi-polynomial", **settings})
    assert message in str(caught.value)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("samples", "error", "message"),
    [
        (1, SettingsError, "leaves a part empty"),
        (4, RecordError, "has 3 samples and 3 are needed before the first row: take a longer recording"),
        (5, SettingsError, "no model could be estimated: too few rows (1 structure); take another library"),
        (10, RecordError, "has 2 samples and the warm-up takes 3: take a longer recording"),
        (20, RecordError, "has 5 samples, of which the warm-up takes 3: testing the residual takes 3 more"),
    ],
)
def test_too_short_record_raises_an_error_with_advice(samples, error, message):
    with pytest.raises(error) as caught:
        islands.fit(tank(samples), library="polynomial")
    assert message in str(caught.value)


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.003), pytest.param(4, 0.01, marks=pytest.mark.ci)])
def test_a_law_that_fails_the_physics_checks_is_recommended_if_the_data_say_so(seed, noise):
    """The law, its estimate and every model that follows the record diverge at a held input."""
    record = runaway(600, seed, noise)
    options = {"degree": 2, "lags": 1, "max_terms": 5, "average": 1, "certificate": 0}
    found = islands.fit(record, library="polynomial", **options)
    best = found.best.model
    assert set(best.equation().terms) == RUNAWAY.keys()
    law = best.with_parameters([RUNAWAY[term] for term in best.equation().terms])
    for model in (law, best):
        assert not all(hold.bounded for hold in check_physics(model, record).holds)
    choice, physics = found.recommendation.reasons
    assert "left out" not in choice
    assert physics.startswith("the data contradict the physics checks")
    lines = describe(result_document(found.search_result))
    assert any(line.startswith(f"Fails at: {physics};") for line in lines)


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, 1])
def test_an_output_that_does_not_depend_on_the_inputs_has_no_model(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, 30), 20)
    found = islands.fit(islands.Dataset(u, 5.0 + rng.standard_normal(600), 0.1, ("u_V",), "y_mm"))
    assert "No model found: no model shows that y_mm depends on u_V" in " ".join(str(found).split())
