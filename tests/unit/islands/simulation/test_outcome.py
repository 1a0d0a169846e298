"""An outcome says what happened and what to do."""

import pytest

from islands.simulation.outcome import OK, Outcome, Verdict


def test_only_ok_is_true():
    assert OK
    assert [verdict for verdict in Verdict if Outcome(verdict)] == [Verdict.OK]


def test_ok_reads_ok():
    assert str(OK) == "ok"


@pytest.mark.parametrize("verdict", [verdict for verdict in Verdict if verdict is not Verdict.OK])
def test_a_failure_reads_kind_reason_and_advice(verdict):
    text = str(Outcome(verdict, "this happened"))
    assert text == f"{verdict.name.lower()}: this happened; {verdict.value}"


def test_every_verdict_has_an_advice_of_its_own():
    advices = [verdict.value for verdict in Verdict]
    assert len(set(advices)) == len(Verdict)
    assert all(len(advice) > 10 for advice in advices)


def test_equal_outcomes_are_equal():
    assert Outcome(Verdict.SINGULAR, "a") == Outcome(Verdict.SINGULAR, "a") != Outcome(Verdict.SINGULAR, "b")
