"""Text summary: sentences about the recommended model, each about a measured quantity, and the table."""

from dataclasses import asdict, replace
from math import inf, nan

import numpy as np
import pytest

import islands
from islands.errors import command_line_names
from islands.evolution.presets import resolve_settings
from islands.models.equations import named_equation
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.text import statements
from islands.report.text.facts import ResultFacts
from islands.report.text.summary import columns, method_text, number, rows, summary, table
from islands.simulation.outcome import EvaluationOutcome, Status
from support.assessments import with_changes
from support.identifications import two_inputs
from support.noisy_records import make_noisy_record
from support.searches import record

LOST = EvaluationOutcome(Status.DIVERGED, "|y| left 1e+06 at sample 17")


@pytest.fixture(scope="module")
def findings():
    data = record(300)
    named = Dataset(data.u, data.y, 0.1, ("u_V",), "y_um", ("V",), "um")
    settings = {"library": "phi-polynomial", "max_terms": 4, "estimator": "least-squares", "seed": 7}
    return islands.fit(named, **settings).with_wall_time(0.5).search_result


def facts_of(found):
    return ResultFacts(result_document(found))


def describe(found):
    return statements.describe(result_document(found))


def test_the_summary_begins_with_sentences_and_contains_the_table(findings):
    text = str(islands.Result.from_search(findings))
    lines = text.splitlines()
    for sentence in (each for each in describe(findings) if "(k) = " not in each):
        assert sentence.strip() in " ".join(text.split())
    assert lines[-1 - len(table(facts_of(findings))) : -1] == table(facts_of(findings))
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


def test_the_essence_is_before_the_equation_with_the_names_and_units_of_the_record(findings):
    head, lines = describe(findings)[:5], describe(findings)[5:]
    assert [line.partition(":")[0] for line in head] == [
        *("As a simulation", "Error", "Physics", "Fails at", "Next"),
    ]
    rank, size = findings.recommendation.rank, findings.recommended.model.size
    assert lines[0].startswith(f"Recommended: model {rank} of 4, size {size}: ")
    assert lines[1].strip().startswith("y_um(k) = y_um(k-1) ")
    assert "(u_V(k-1) - u_V(k-2))" in lines[1]
    assert lines[2].strip() == "y_um in um, u_V in V; k counts samples of 0.1 s."
    rmse = findings.recommended.metrics["validation"]["free_run"].rmse
    assert f"RMSE {rmse:.4g} um" in head[1]


def test_the_method_of_a_latent_search_has_the_numbers_of_its_settings(findings):
    changes = {"population": 18, "elite": 0.5, "crossover": 0.4, "tournament": 5, "islands": 3}
    changes |= {"migrate_every": 2, "migrants": 4, "constraints": "odd; gain = 3", "structure": "hammerstein"}
    settings = asdict(resolve_settings("latent", changes))
    search = replace(findings.search, generations=7)
    text = " ".join(method_text(replace(findings, settings=settings, search=search)).split())
    for part in (
        "on 3 islands for 7 generations of 18 offspring",
        "with probability 0.4",
        "the best one of 5",
        "the elite of an island has 9 systems",
        "topology ring, every 2 generations, 4 systems at most",
        "Structure hammerstein: no unit reads a state.",
        "Constraint odd: ",
        "so that they meet gain = 3.",
    ):
        assert part in text
    one = method_text(replace(findings, settings=settings | {"islands": 1, "constraints": "none"}))
    assert "on 1 island for" in one
    assert "Migration" not in one
    assert "Constraint" not in one


def y_of_a_lag(u):
    y = np.zeros_like(u)
    for k in range(1, u.size):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1]
    return y


@pytest.mark.nightly
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
    with command_line_names({"estimator"}):
        assert "Next: estimate with --set estimator=free-run:" in " ".join(str(biased).split())
    for unbiased in (islands.fit(data, **settings), islands.fit(data, estimator="free-run", **settings)):
        assert unbiased.best.model.parameter_names == ("y(k-1)", "u1(k-1)", "u1(k-1)^2")
        assert "estimator=" not in str(unbiased)
    linear = islands.fit(replace(data, y=y_of_a_lag(u) + 0.02 * rng.standard_normal(1200)), **settings)
    assert linear.best.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert "estimator=" not in str(linear)


@pytest.mark.ci
def test_constraints_of_the_user_are_stated_with_the_names_of_the_record(findings):
    data = two_inputs(seed=0)
    named = Dataset(data.u, data.y, 0.01, ("heat_W", "valve"), "T_K", ("W", ""), "K")
    statements = "[u2(k-1)] >= 0; gain(u2) = 0"
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0}
    found = islands.fit(named[:400], constraints=statements, average=1, **settings).search_result
    lines = summary(result_document(found), found.recommended.model).splitlines()
    assert "Constraints that the model meets: [valve(k-1)] >= 0; gain(valve) = 0." in lines


def test_an_empty_estimator_is_named_in_the_settings(findings):
    chosen = replace(findings, settings=dict(findings.settings) | {"estimator": "", "own_primitives": {}})
    assert "estimator by validation," in " ".join(method_text(chosen).split())
    assert "own_primitives" not in method_text(chosen)


@pytest.mark.ci
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
    assert "its limit in the flat samples" not in " ".join(statements.describe(free))
    assert "its limit in the flat samples" in " ".join(statements.describe(limited))


def with_first(findings, **changes):
    """Return the result with a changed assessment of its first model."""
    first, *others = findings.models
    return replace(findings, models=(with_changes(first, **changes), *others))


def first_cells(findings, **changes):
    return dict(
        zip(columns(facts_of(findings)), rows(facts_of(with_first(findings, **changes)))[0], strict=True)
    )


def test_the_table_has_a_row_per_model_and_aligned_columns(findings):
    head, *lines = table(facts_of(findings))
    assert head.split("  ")[0] == "rank"
    assert len(lines) == len(findings.models)
    assert len({len(line) for line in (head, *lines)}) == 1
    first = findings.models[0]
    cells = first_cells(findings)
    assert cells["terms"] == str(first.model.size)
    assert cells["MAPE est. %"] == f"{first.metrics['estimation']['free_run'].mape:.4f}"
    assert cells["Property 1"] == "yes"


def test_only_the_recommended_model_has_a_mark(findings):
    marked = [row[0] for row in rows(facts_of(findings)) if "*" in row[0]]
    assert marked == [f"{findings.recommendation.rank}*"]
    assert [row[0].strip(" *") for row in rows(facts_of(findings))] == ["1", "2", "3", "4"]


@pytest.mark.ci
def test_columns_of_hysteresis_need_a_model_that_claims_it(findings):
    plain = islands.fit(record(300), library="polynomial", degree=1, max_terms=2).search_result
    assert not any(entry.physics.property_1 for entry in plain.models)
    assert not {"drift %", "Property 1"} & set(columns(facts_of(plain)))
    assert {"drift %", "Property 1"} <= set(columns(facts_of(findings)))
    free = replace(findings, settings={**findings.settings, "constraints": "none"})
    assert columns(facts_of(free)) == columns(facts_of(findings))
    assert all(len(row) == len(columns(facts_of(plain))) for row in rows(facts_of(plain)))


def test_the_table_distinguishes_divergence_from_an_undefined_number(findings):
    first = findings.models[0]
    flat = replace(first.metrics["validation"]["free_run"], mape=nan, r2=nan)
    without = {**first.metrics, "validation": {**first.metrics["validation"], "free_run": flat}}
    cells = first_cells(findings, metrics=without)
    assert (cells["MAPE val. %"], cells["R2 val."]) == ("-", "-")
    without["validation"]["free_run"] = replace(flat, rmse=nan)
    cells = first_cells(findings, metrics=without)
    assert (cells["MAPE val. %"], cells["R2 val."]) == ("diverged", "diverged")
    assert cells["MAPE est. %"] == f"{first.metrics['estimation']['free_run'].mape:.4f}"
    holds = (replace(first.physics.holds[0], bounded=False, drift_percent=inf), *first.physics.holds[1:])
    cells = first_cells(findings, physics=replace(first.physics, holds=holds))
    assert (cells["drift %"], cells["Property 1"]) == ("diverged", "no")


def test_a_number_is_shown_in_the_given_format():
    assert number(0.12345, "{:.3f}", True) == "0.123"
    assert number(None, "{:.3f}", True) == "-"
    assert number(0.12345, "{:.3f}", False) == "diverged"
