"""Outcomes of evaluations: status, reason and advice."""

import pytest

from islands.simulation.outcome import OK, EvaluationOutcome, Status


def test_only_ok_is_true():
    assert OK
    assert [verdict for verdict in Status if EvaluationOutcome(verdict)] == [Status.OK]


def test_text_of_ok_is_ok():
    assert str(OK) == "ok"


@pytest.mark.parametrize("verdict", [verdict for verdict in Status if verdict is not Status.OK])
def test_text_of_a_failure_contains_kind_reason_and_advice(verdict):
    text = str(EvaluationOutcome(verdict, "this happened"))
    assert text == f"{verdict.name.lower()}: this happened; {verdict.value}"


def test_every_status_has_a_distinct_advice():
    advices = [verdict.value for verdict in Status]
    assert len(set(advices)) == len(Status)
    assert all(len(advice) > 10 for advice in advices)


def test_equal_outcomes_are_equal():
    assert (
        EvaluationOutcome(Status.SINGULAR, "a")
        == EvaluationOutcome(Status.SINGULAR, "a")
        != EvaluationOutcome(Status.SINGULAR, "b")
    )
