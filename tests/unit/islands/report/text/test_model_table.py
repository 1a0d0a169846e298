"""Table of models: cells, mark of the recommended model, columns of hysteresis."""

from dataclasses import replace
from math import inf, nan

import pytest

import islands
from islands.report.documents.result_folder import result_document
from islands.report.text import model_table
from islands.report.text.model_table import number
from islands.simulation.outcome import EvaluationOutcome, Status
from support.assessments import with_changes
from support.searches import record

LOST = EvaluationOutcome(Status.DIVERGED, "|y| left 1e+06 at sample 17")


@pytest.fixture(scope="module")
def findings():
    return islands.fit(record(300), library="phi-polynomial", max_terms=4).search_result


def columns(found):
    return model_table.columns(result_document(found))


def rows(found):
    return model_table.rows(result_document(found))


def with_first(findings, **changes):
    """Return the result with a changed assessment of its first model."""
    first, *others = findings.models
    return replace(findings, models=(with_changes(first, **changes), *others))


def first_cells(findings, **changes):
    return dict(zip(columns(findings), rows(with_first(findings, **changes))[0], strict=True))


def test_the_table_has_a_row_per_model_and_aligned_columns(findings):
    head, *lines = model_table.table(result_document(findings))
    assert head.split("  ")[0] == "rank"
    assert len(lines) == len(findings.models) + 1
    assert lines[-1].split()[:2] == ["lin.", str(findings.linear.model.size)]
    assert len({len(line) for line in (head, *lines)}) == 1
    first = findings.models[0]
    cells = first_cells(findings)
    assert cells["terms"] == str(first.model.size)
    assert cells["MAPE est. %"] == f"{first.metrics['estimation']['free_run'].mape:.4f}"
    assert cells["Property 1"] == "yes"


def test_only_the_recommended_model_has_a_mark(findings):
    marked = [row[0] for row in rows(findings) if "*" in row[0]]
    assert marked == [f"{findings.recommendation.rank}*"]
    assert [row[0].strip(" *") for row in rows(findings)] == ["1", "2", "3", "4"]


def test_columns_of_hysteresis_need_a_model_that_claims_it(findings):
    plain = islands.fit(record(300), library="polynomial", degree=1, max_terms=2).search_result
    assert not any(entry.physics.property_1 for entry in plain.models)
    assert not {"drift %", "Property 1"} & set(columns(plain))
    assert {"drift %", "Property 1"} <= set(columns(findings))
    free = replace(findings, settings={**findings.settings, "constraints": "none"})
    assert columns(free) == columns(findings)
    assert all(len(row) == len(columns(plain)) for row in rows(plain))


def test_the_table_distinguishes_divergence_from_an_undefined_number(findings):
    first = findings.models[0]
    flat = replace(first.metrics["validation"]["free_run"], mape=nan, r2=nan)
    without = {**first.metrics, "validation": {**first.metrics["validation"], "free_run": flat}}
    cells = first_cells(findings, metrics=without)
    assert (cells["MAPE val. %"], cells["R2 val."]) == ("-", "-")
    outcomes = {**first.outcomes, "validation": {**first.outcomes["validation"], "free_run": LOST}}
    cells = first_cells(findings, metrics=without, outcomes=outcomes)
    assert (cells["MAPE val. %"], cells["R2 val."]) == ("diverged", "diverged")
    assert cells["MAPE est. %"] == f"{first.metrics['estimation']['free_run'].mape:.4f}"
    holds = (replace(first.physics.holds[0], bounded=False, drift_percent=inf), *first.physics.holds[1:])
    cells = first_cells(findings, physics=replace(first.physics, holds=holds))
    assert (cells["drift %"], cells["Property 1"]) == ("diverged", "no")


def test_a_number_is_shown_in_the_given_format():
    assert number(0.12345, "{:.3f}", True) == "0.123"
    assert number(None, "{:.3f}", True) == "-"
    assert number(0.12345, "{:.3f}", False) == "diverged"
