"""Text summary: sentences about the recommended model, each about a measured quantity, and the table."""

from dataclasses import replace
from math import nan

import numpy as np
import pytest

import islands
from islands.errors import command_line_names
from islands.estimation.estimator_table import (
    BOX_JENKINS,
    ESTIMATORS,
    LEAST_SQUARES,
    OUTPUT_ERROR,
    Criterion,
    make_criterion,
)
from islands.expressions.parsing import parse
from islands.models.equations import named_equation, named_term
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.report.documents.result_folder import result_document
from islands.report.text import statements
from islands.report.text.model_table import table
from islands.report.text.summary import method_text, summary
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.validation.ensemble import Ensemble
from islands.validation.metrics import Metrics
from islands.validation.predictable_residual import ResidualStructure
from support.assessments import with_changes
from support.identifications import two_inputs
from support.noisy_records import make_noisy_record
from support.searches import record

LOST = EvaluationOutcome(Status.DIVERGED, "at sample 17")


@pytest.fixture(scope="module")
def findings():
    data = record(300)
    named = Dataset(data.u, data.y, 0.1, ("u_V",), "y_um", ("V",), "um")
    settings = {"library": "phi-polynomial", "max_terms": 4, "estimator": "least-squares", "seed": 7}
    return islands.fit(named, **settings).with_wall_time(0.5).search_result


def describe(found):
    return statements.describe(result_document(found))


def said(findings, **changes):
    """Return the sentences by first word, for a result with one model whose assessment is changed."""
    changed = with_changes(findings.recommended, **changes)
    lines = describe(replace(findings, models=(changed,)))
    return {line.partition(":")[0]: line for line in lines if not line.startswith(" ")}


def errors(findings, validation, **others):
    metrics = findings.recommended.metrics
    return {
        "estimation": metrics["estimation"] | others,
        "validation": metrics["validation"] | {"free_run": validation},
    }


def test_the_summary_begins_with_sentences_and_contains_the_table(findings):
    text = str(islands.Result.from_search(findings))
    lines = text.splitlines()
    first, _equation, *sentences = describe(findings)
    for sentence in (first, *sentences):
        assert sentence.strip() in " ".join(text.split())
    assert lines[-7:-1] == table(result_document(findings))
    assert lines[-1].startswith("* recommended; ranked by")
    assert max(map(len, lines)) <= 80


def test_the_method_has_settings_numbers_and_all_equations(findings):
    lines = method_text(findings).splitlines()
    assert lines[0] == "300 samples, 0.1 s: u_V to y_um"
    count = findings.search.evaluations
    end = lines.index(f"{count} models estimated: {count} ok")
    assert "library phi-polynomial" in lines[1]
    assert lines[end - 1].endswith("seed 7")
    assert lines[end + 1].startswith("full polynomial set: 462 candidates, a matrix of 1 MB")
    assert [line[4:] for line in lines[-4:]] == [named_equation(entry.model) for entry in findings.models]


def test_the_equation_has_the_names_and_units_of_the_record(findings):
    first, text, units, _parameters, error, *_ = describe(findings)
    rank, size = findings.recommendation.rank, findings.recommended.model.size
    assert first.startswith(f"Recommended: model {rank} of 4, size {size}: ")
    assert text.strip().startswith("y_um(k) = y_um(k-1) ")
    assert "(u_V(k-1) - u_V(k-2))" in text
    assert units.strip() == "y_um in um, u_V in V; k counts samples of 0.1 s."
    rmse = findings.recommended.metrics["validation"]["free_run"].rmse
    assert f"RMSE {rmse:.4g} um" in error


def test_dry_friction_is_stated_in_the_units_of_output_and_input(findings):
    document = result_document(findings)
    place = document["recommended"]["rank"] - 1
    for regressor in ("u(k-1)", "sign(y(k-1))"):
        term = {"regressor": regressor, "parameter": -0.9, "standard_error": 0.001, "term": regressor}
        document["models"][place]["terms"].append(term)
    assert not [line for line in statements.describe(document) if line.startswith("Dry friction")]
    document["record"]["units"] |= {"output": "rad/s"}
    document["models"][place]["terms"] = document["models"][place]["terms"][-2:]
    (line,) = (line for line in statements.describe(document) if line.startswith("Dry friction"))
    assert line == (
        "Dry friction: 0.9 rad/s against the motion in each sample of 0.1 s, as much as 1 V of u_V."
    )


def test_uses_and_failures_follow_the_free_run(findings):
    good, bad = Metrics(1.0, 0.99, 0.1, 90.0), Metrics(20.0, 0.3, 2.0, 10.0)
    assert "simulation from the inputs alone" in said(findings, metrics=errors(findings, good))["Good for"]
    poor = said(findings, metrics=errors(findings, bad))
    assert "simulation" not in poor["Good for"]
    assert "prediction one step ahead" in poor["Good for"]
    assert "simulation from the inputs alone: R2 0.300" in poor["Fails at"]
    lost = Metrics(nan, nan, nan, nan)
    outcomes = findings.recommended.outcomes
    outcomes = {**outcomes, "validation": {**outcomes["validation"], "free_run": LOST}}
    diverged = said(findings, metrics=errors(findings, lost), outcomes=outcomes)
    assert "the free run on the validation data diverges" in diverged["Error"]


def test_an_error_that_grows_on_validation_data_is_a_failure(findings):
    small, large = Metrics(1.0, 0.99, 0.1, 90.0), Metrics(3.0, 0.95, 0.31, 70.0)
    found = said(findings, metrics=errors(findings, large, free_run=small))
    assert "3.1 times that on the estimation data" in found["Fails at"]
    assert "estimate from a record that covers" in found["Next"]
    assert "times that" not in said(findings, metrics=errors(findings, small, free_run=small))["Fails at"]


def test_excursions_and_holds_that_diverge_are_failures(findings):
    physics = findings.recommended.physics
    fast = (*physics.excursions[:-1], replace(physics.excursions[-1], bounded=False))
    found = said(findings, physics=replace(physics, excursions=fast))
    assert "diverges at rate x 5" in found["Fails at"]
    assert "no model passes the physics checks" in found["Fails at"]
    holds = (replace(physics.holds[0], bounded=False), *physics.holds[1:])
    assert "diverges in 1 of 10 holds" in said(findings, physics=replace(physics, holds=holds))["Fails at"]
    drifting = tuple(replace(hold, constant=False, drift_percent=7.5) for hold in physics.holds)
    found = said(findings, physics=replace(physics, holds=drifting))
    assert "drifts by 7.5 % of its range at constant input" in found["Fails at"]
    opened = tuple(replace(test, closure_percent=6.0) for test in physics.excursions)
    found = said(findings, physics=replace(physics, excursions=opened))
    assert "loops do not close at minor-loops: 6 %" in found["Fails at"]


def test_structure_in_the_residual_is_a_failure_with_a_hint(findings):
    tests = findings.recommended.residual_tests
    worst = tests.tests[3]
    assert worst.name == "u2_xi"
    values = worst.values.copy()
    values[3] = 0.9
    changed = replace(tests, tests=(*tests.tests[:3], replace(worst, values=values), tests.tests[4]))
    structure = ResidualStructure(0.4, 0.5, 0.7, "minor")
    found = said(findings, residual_tests=changed, residual_structure=structure)
    assert "50 % of the free-run residual is predictable (RMS 0.7 % of the output range)" in found["Fails at"]
    assert "even terms in u_V" in found["Next"]
    assert "no structure" not in found["Good for"]


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ((0.5, 0.02), "no structure is left in the free-run residual (at most 10 % is predictable)"),
        ((0.02, 0.02), "no structure is left in the free-run residual (at most 10 % is predictable)"),
        ((0.02, 0.5), "the residual is a rounding error"),
        ((0.5, 0.5), "the residual is a rounding error"),
    ],
)
def test_the_unpredictable_residual_is_named(findings, shares, expected):
    found = said(findings, residual_structure=ResidualStructure(*shares, 0.7, "adequate"))
    assert expected in found["Good for"]
    assert "terms in" not in found["Next"]


def test_the_verdict_is_that_of_the_free_run(findings):
    """A white one-step-ahead residual passed all checks, with a predictable error of the free run."""
    drifting = ResidualStructure(0.02, 0.939, 5.0, "inadequate")
    found = said(findings, residual_structure=drifting)
    assert found["As a simulation"].startswith(
        "As a simulation: usable, with limits (94 % of the residual of"
    )
    assert found["As a simulation"].endswith("one step ahead, 2 % is predictable).")
    assert "94 % of the free-run residual is predictable (RMS 5 % of the output range)" in found["Fails at"]
    assert "within the limits below" in found["Good for"]
    assert '(estimator="free-run")' in found["Next"]
    fine = ResidualStructure(0.02, 0.03, 0.1, "adequate")
    physics = findings.recommended.physics
    closed = replace(
        physics, excursions=tuple(replace(test, closure_percent=0.0) for test in physics.excursions)
    )
    found = said(findings, residual_structure=fine, physics=closed)
    assert found["As a simulation"].startswith("As a simulation: good (3 % of")
    assert found["Fails at"] == "Fails at: none of the checks."
    poor = said(findings, metrics=errors(findings, Metrics(20.0, 0.3, 2.0, 10.0)), residual_structure=fine)
    assert poor["As a simulation"].startswith("As a simulation: unsuitable")


def test_the_verdict_has_the_error_against_the_noise_level(findings):
    noisy = Metrics(20.0, 0.3, 2.0, 10.0)
    found = statements.describe(with_noise(findings, 1.9, metrics=errors(findings, noisy)))
    text = " ".join(found)
    # Nothing can follow an output better than to its noise.
    assert "RMSE at the noise level of y_um, 1.9 um" in text
    assert "simulation from the inputs alone: R2" not in text
    text = " ".join(statements.describe(with_noise(findings, 0.5, metrics=errors(findings, noisy))))
    assert "As a simulation: unsuitable" in text
    assert "RMSE 4 times the noise level of y_um, 0.5 um" in text
    white = ResidualStructure(0.02, 0.02, 0.7, "adequate")
    one = replace(noisy, rmse=0.8)
    changed = errors(findings, noisy) | {"validation": {"free_run": noisy, "one_step_ahead": one}}
    changed["validation"] |= {"multiple_shooting": noisy}
    document = with_noise(findings, None, metrics=changed, residual_structure=white)
    assert "RMSE 2.5 times the unpredictable error one step ahead" in " ".join(statements.describe(document))


def y_of_a_lag(u):
    y = np.zeros_like(u)
    for k in range(1, u.size):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1]
    return y


@pytest.mark.ci
def test_noise_of_the_output_is_a_reason_for_the_free_run_estimate(findings):
    """Least squares is biased by the noise; linear models are estimated for the free run as well."""
    rng = np.random.default_rng(0)
    u, y = rng.uniform(-1.0, 1.0, 1200), np.zeros(1200)
    for k in range(1, 1200):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1] + 0.2 * u[k - 1] ** 2
    data = Dataset(u, y + 0.02 * rng.standard_normal(1200), 0.1)
    settings = {"library": "polynomial", "degree": 2, "lags": 2, "certificate": 0, "average": 1}
    biased = islands.fit(data, estimator="least-squares", **settings)
    assert 'Next: estimate with estimator="free-run":' in " ".join(str(biased).split())
    with command_line_names():
        assert "Next: estimate with --estimator free-run:" in " ".join(str(biased).split())
    for unbiased in (islands.fit(data, **settings), islands.fit(data, estimator="free-run", **settings)):
        assert unbiased.best.model.parameter_names == ("y(k-1)", "u1(k-1)", "u1(k-1)^2")
        assert "estimator=" not in str(unbiased)
    linear = islands.fit(replace(data, y=y_of_a_lag(u) + 0.02 * rng.standard_normal(1200)), **settings)
    assert linear.best.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert "estimator=" not in str(linear)
    # With noise in the equation, the free run is not better than the prediction one step ahead.
    white = ResidualStructure(0.02, 0.02, 0.7, "adequate")
    free = Metrics(1.0, 0.99, 2.0, 90.0)
    disturbed = said(findings, metrics=errors(findings, free), residual_structure=white)
    assert "estimate with --estimator" not in disturbed["Next"]


@pytest.mark.parametrize(
    ("criterion", "expected"),
    [
        (LEAST_SQUARES, "least squares of the error one step ahead"),
        (Criterion("shooting", 500), "least error of simulations over 500 samples"),
        (OUTPUT_ERROR, "least error of the free run and its initial state (linear output-error model)"),
        (
            BOX_JENKINS,
            "least error of the free run and its initial state, whitened (linear Box-Jenkins model)",
        ),
        *((make_criterion(name, 500), "least") for name in ESTIMATORS),
    ],
)
def test_the_error_that_the_parameters_minimise_is_stated(findings, criterion, expected):
    stated = said(findings, criterion=criterion)["Parameters"]
    assert stated.startswith(f"Parameters: {expected}")
    assert stated.endswith(", under constraints.")
    assert "constraints" not in said(findings, criterion=criterion, constraints=())["Parameters"]


def test_a_free_run_estimate_is_no_advice_for_a_model_that_has_it(findings):
    drifting = ResidualStructure(0.02, 0.939, 5.0, "inadequate")
    for criterion in (LEAST_SQUARES, Criterion("shooting", 500)):
        advice = said(findings, residual_structure=drifting, criterion=criterion)["Next"]
        assert "try an estimate that minimises the error of the free run" in advice
    for criterion in (OUTPUT_ERROR, Criterion("free-run", None)):
        assert "--estimator" not in said(findings, residual_structure=drifting, criterion=criterion)["Next"]


def test_a_result_of_an_earlier_version_states_no_criterion(findings):
    document = result_document(findings)
    for entry in document["models"]:
        del entry["criterion"]
    text = " ".join(statements.describe(document))
    assert "Parameters:" not in text
    assert "--estimator" not in text


def with_noise(findings, noise, **changes):
    """Return the document of a result with one changed model and a noise level of the output."""
    changed = with_changes(findings.recommended, **changes)
    document = result_document(replace(findings, models=(changed,)))
    document["data"]["noise"] = noise
    return document


def test_an_unpredictable_error_far_above_the_noise_is_a_limit(findings):
    """A valve that sticks: the residual of 10 times the noise is a state that no regressor has."""
    white = ResidualStructure(0.02, 0.02, 0.7, "adequate")
    metrics = errors(findings, Metrics(1.0, 0.99, 1.0, 90.0))
    far = " ".join(statements.describe(with_noise(findings, 0.1, metrics=metrics, residual_structure=white)))
    assert "As a simulation: usable, with limits" in far
    assert "the free-run error is 10 times the noise level, and neither inputs nor past outputs" in far
    assert "no structure is left in the free-run residual" not in far
    near = " ".join(statements.describe(with_noise(findings, 0.5, metrics=metrics, residual_structure=white)))
    assert "times the noise level, and neither" not in near
    assert "no structure is left in the free-run residual" in near


@pytest.mark.parametrize("noise", [None, 0.1])
def test_no_model_is_found_of_an_output_that_nothing_predicts(findings, noise):
    """White noise next to an input that does not act: its level is that of the output, and of the error."""
    white = ResidualStructure(0.4, 0.02, 0.7, "adequate")
    mean, past = Metrics(9.0, -0.003, 0.1, 0.0), Metrics(9.0, -1.0, 0.14, 0.0)
    metrics = {part: {"free_run": mean, "one_step_ahead": past} for part in ("estimation", "validation")}
    document = with_noise(findings, noise, metrics=metrics, residual_structure=white, criterion=LEAST_SQUARES)
    text = " ".join(statements.describe(document))
    assert text.startswith("No model found: the free run explains 0 % of the variance of y_um, and neither")
    assert "As a simulation: unsuitable" in text
    assert text.endswith("Next: check that u_V acts on y_um.")


@pytest.mark.parametrize(("one_step", "is_far"), [(0.2, False), (2.0, True)])
def test_an_error_one_step_ahead_far_above_the_noise_has_structure(findings, one_step, is_far):
    """The correlations of a residual do not show a steep nonlinearity, as that of a titration curve."""
    hidden = ResidualStructure(0.02, 0.5, 7.0, "inadequate")
    metrics = errors(findings, Metrics(5.0, 0.95, 3.0, 80.0))
    metrics["validation"]["one_step_ahead"] = Metrics(5.0, 0.95, one_step, 80.0)
    changes = {"metrics": metrics, "residual_structure": hidden, "criterion": LEAST_SQUARES}
    advice = statements.describe(with_noise(findings, 0.1, **changes))[-1]
    assert ("one step ahead, no structure is left (at most 10 % is predictable)" in advice) != is_far
    stated = (
        "try terms of another form (a higher degree, another library): the error one step ahead is 20 times"
    )
    assert (stated in advice) == is_far


@pytest.mark.parametrize(
    ("settings", "advice"),
    [
        ({}, "try another class of models, as NARX (model="),
        ({"structure": "wiener"}, "try any structure (structure="),
    ],
)
def test_a_model_with_named_parameters_has_no_terms_in_its_texts(findings, settings, advice):
    document = result_document(findings)
    document["settings"] = {"method": "fit", "constraints": "none", **settings}
    for entry in document["models"]:
        entry["kind"] = "latent"
    document["models"][document["recommended"]["rank"] - 1]["residual_tests"] |= {
        "verdict": "inadequate",
        "predictable_share": {"one_step_ahead": 0.9, "free_run": 0.9},
    }
    sentences = statements.describe(document)
    assert advice in sentences[-1]
    assert "terms" not in sentences[-1]
    assert not any("inclusion" in each for each in sentences)
    assert table(document)[0].split()[:2] == ["rank", "parameters"]


def test_the_advice_to_increase_lags_names_the_option_with_a_value(findings):
    document = result_document(findings)
    document["models"][document["recommended"]["rank"] - 1]["residual_tests"] |= {
        "verdict": "inadequate",
        "predictable_share": {"one_step_ahead": 0.9, "free_run": 0.9},
    }
    lags = document["settings"]["lags"]
    with command_line_names():
        assert f"larger lags: --lags {2 * lags}" in statements.describe(document)[-1]
    document["settings"]["library_lags"] = document["settings"].pop("lags")
    assert f"larger lags: library_lags={2 * lags}" in statements.describe(document)[-1]


def test_an_output_that_escapes_at_an_extreme_is_a_failure_with_the_input(findings):
    physics = findings.recommended.physics
    assert "held at up to 1.2 times their recorded amplitude" in said(findings)["Good for"]
    far, lost, *others = physics.extremes
    changed = replace(physics, extremes=(replace(far, bounded=False), replace(lost, ranges=1940.0), *others))
    found = said(findings, physics=changed)
    record = findings.split.estimation
    assert "held at up to 0.8 times their recorded amplitude" in found["Good for"]
    assert (
        f"the output leaves its recorded range by 1.94e+03 ranges at u_V = {record.u.min():.4g} V (1 of the "
        "recorded amplitude)"
    ) in found["Fails at"]
    assert "the output diverges at u_V = " in found["Fails at"]


def test_a_band_that_misses_the_validation_data_is_a_failure(findings):
    bands = findings.recommended.bands
    assert 0.75 <= bands.coverage <= 1.0
    found = said(findings, bands=replace(bands, coverage=0.5))
    assert "the 90 % prediction band contains 50 % of the validation samples" in found["Fails at"]
    assert "prediction band" not in said(findings)["Fails at"]


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        (7.2, "count as about 7 independent samples, so that the RMSE on new data may be 1.8 times as large"),
        (3.0, "may be 3 times as large"),
        (2.0, "may be 5 times as large"),
        (16.0, "may be 1.4 times as large"),
        (18.0, ""),
        (None, ""),
    ],
)
def test_an_error_that_few_independent_samples_measure_is_uncertain(findings, samples, expected):
    """The ratios are those of the quantile of 5 % of the chi-square distribution, at most 5."""
    bands = replace(findings.recommended.bands, independent_samples=samples)
    found = said(findings, bands=bands)["As a simulation"]
    assert expected in found
    assert ("independent samples" in found) == bool(expected)


def test_a_band_that_is_wider_than_the_output_range_is_a_failure(findings):
    bands, output_range = findings.recommended.bands, findings.record.output_range
    half = bands.typical_half_width()
    found = said(findings, bands=replace(bands, width=bands.width * 0.51 * output_range / half))
    assert "the 90 % prediction band is wider than the output range" in found["Fails at"]
    assert found["As a simulation"].startswith("As a simulation: usable, with limits")
    found = said(findings, bands=replace(bands, width=bands.width * 0.49 * output_range / half))
    assert "wider than" not in found["Fails at"]


def test_an_extrapolating_validation_is_a_failure(findings):
    parts = findings.split
    wide = replace(parts.validation, u=3.0 * parts.validation.u)
    changed = replace(findings, split=Split(parts.estimation, wide))
    low, high = wide.u.min(), wide.u.max()
    assert (
        f"extrapolation: u_V is {low:.4g} to {high:.4g} V in the validation data" in said(changed)["Fails at"]
    )
    assert "extrapolation" not in said(findings)["Fails at"]
    document = result_document(changed)
    document["preprocessing"]["average"] = 2
    assert "in the estimation data, in means of 2 samples" in " ".join(statements.describe(document))


def test_the_ratio_of_two_rounding_errors_is_not_a_failure(findings):
    small, large = Metrics(1e-14, 1.0, 1e-16, 100.0), Metrics(3e-14, 1.0, 3e-16, 100.0)
    assert "times that" not in said(findings, metrics=errors(findings, large, free_run=small))["Fails at"]
    assert "covers" not in said(findings, metrics=errors(findings, large, free_run=small))["Next"]


def test_a_parameter_below_two_standard_errors_is_named(findings):
    entry = findings.recommended
    theta = entry.model.parameters
    model = entry.model.with_parameters(theta, [abs(value) / 3 for value in theta])
    certain = describe(replace(findings, models=(replace(entry, model=model),)))[-1]
    assert "standard errors" not in certain
    model = entry.model.with_parameters(theta, [abs(theta[0]), *(abs(value) / 3 for value in theta[1:])])
    weak = describe(replace(findings, models=(replace(entry, model=model),)))[-1]
    assert "the parameter of y_um(k-1) is within two standard errors of zero" in weak
    # No smaller model is as good, unless the search alone has chosen the model.
    assert "smaller model" not in weak
    settings = {**findings.settings, "select": "fitness", "fitness": "free-run"}
    fittest = describe(replace(findings, models=(replace(entry, model=model),), settings=settings))[-1]
    assert "try a longer record or a smaller model, since" in fittest


def test_the_uncertainty_has_the_half_width_of_the_band_and_the_doubtful_terms(findings):
    entry = findings.recommended
    half = entry.bands.typical_half_width(0.9)
    sentence = said(findings)["Uncertainty"]
    assert f"90 % prediction band of the free run has a median half-width of {half:.4g} um;" in sentence
    excluded = replace(findings, ensemble=Ensemble(findings.ensemble.structures[:0]))
    found = said(excluded)
    assert f"{named_term(entry.model, 0)} 0.00" in found["Uncertainty"]
    assert f"models without {named_term(entry.model, 0)} are about as good" in found["Next"]
    # Without a disturbance that was not measured, models of an R2 of 0.61 and of -0.04 were "about as good".
    poor = with_changes(entry, metrics=errors(findings, Metrics(9.0, 0.61, 9.0, 38.0)))
    assert "models without" not in said(replace(excluded, models=(poor,)))["Next"]
    almost = replace(findings.ensemble.structures[0], model=entry.model, weight=0.8999)
    other = replace(almost, model=make_model([(parse("u(k-9)"), 1.0)]), weight=0.1001)
    doubtful = said(replace(findings, ensemble=Ensemble((almost, other))))["Uncertainty"]
    assert f"{named_term(entry.model, 0)} 0.89" in doubtful
    certain = replace(findings.ensemble.structures[0], model=entry.model, weight=1.0)
    kept = replace(findings, ensemble=Ensemble((certain,)))
    assert said(kept)["Uncertainty"].endswith("every term has an inclusion probability of 0.9 or more.")
    assert "models without" not in said(kept)["Next"]


def test_nothing_is_said_about_bands_that_a_result_lacks(findings):
    lacking = replace(findings, models=(replace(findings.recommended, bands=None),))
    assert not [line for line in describe(lacking) if line.startswith("Uncertainty")]


def test_constraints_of_the_user_are_stated_with_the_names_of_the_record(findings):
    data = two_inputs(seed=0)
    named = Dataset(data.u, data.y, 0.01, ("heat_W", "valve"), "T_K", ("W", ""), "K")
    statements = "[u2(k-1)] >= 0; gain(u2) = 0"
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0}
    found = islands.fit(named[:400], constraints=statements, average=1, **settings).search_result
    lines = summary(result_document(found), found.recommended.model).splitlines()
    assert "Constraints that the model meets: [valve(k-1)] >= 0; gain(valve) = 0." in lines
    checks = [
        replace(check, value=value, met=False)
        for check, value in zip(found.recommended.constraints, (-0.5, nan), strict=True)
    ]
    failed = said(found, constraints=tuple(checks))
    assert "Constraints that the model meets" not in failed
    assert "the constraint [valve(k-1)] >= 0 (value -0.5)" in failed["Fails at"]
    assert "the constraint gain(valve) = 0 (value undefined)" in failed["Fails at"]
    assert "Constraints that the model meets" not in said(findings)  # Property 1 is a physics check


def test_an_empty_estimator_is_named_in_the_settings(findings):
    chosen = replace(findings, settings=dict(findings.settings) | {"estimator": "", "own_primitives": {}})
    assert "estimator by validation," in " ".join(method_text(chosen).split())
    assert "own_primitives" not in method_text(chosen)


def test_advice_about_a_saturated_output_names_the_class_of_models_with_a_limit():
    data = make_noisy_record("output", 1, 400)
    limit = float(np.quantile(data.y, 0.9))
    settings = {"library": "polynomial", "degree": 2, "lags": 1, "max_terms": 3, "average": 1}
    free, limited = (
        result_document(islands.fit(each, certificate=0, **settings).search_result)
        for each in (data, replace(data, y=np.minimum(data.y, limit)))
    )
    assert free["data"]["output_limits"] == [None, None]
    assert limited["data"]["output_limits"] == [None, limit]
    assert "its limit in the flat samples" not in statements.describe(free)[-1]
    assert "its limit in the flat samples" in statements.describe(limited)[-1]
