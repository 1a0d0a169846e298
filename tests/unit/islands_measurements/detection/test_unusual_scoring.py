"""Scores of trials with unusual causes."""

from dataclasses import replace

import pytest

from islands.effects.catalogue import CATALOGUE
from islands_measurements.detection.injection.unusual.table import UNUSUAL_CAUSES
from islands_measurements.detection.scoring import Proportion, Statistic
from islands_measurements.detection.unusual_scoring import (
    Answer,
    classify_answer,
    count_answers,
    list_sure_claims,
    score_unusual,
)
from islands_measurements.detection.unusual_trial import Claim, FreshErrors, UnusualOutcome, UnusualTrial

#: Names that the catalogue has not, and that a later analysis may give.
LATER = {
    *("ignored-input", "quantisation", "quantised-input", "quantiser"),
    *("sensor-delay", "output-backlash", "asymmetric-gain", "uneven-lag"),
}

HELD = FreshErrors(10.0, 1.0, 10.0, 1.0)
WORSE = FreshErrors(10.0, 12.0, 10.0, 12.0)


def effect(name: str, confidence: float = 0.95, *equivalents: str, loss: float | None = 5.0) -> Claim:
    return Claim(name, "", confidence, equivalents, loss=loss)


def term(text: str, confidence: float = 0.95, loss: float | None = 5.0) -> Claim:
    return Claim("missing-term", text, confidence, loss=loss)


def outcome(
    cause: str, *claims: Claim, verdict: str = "", fresh: FreshErrors | None = None
) -> UnusualOutcome:
    said = verdict or ("named" if claims else "nothing")
    return UnusualOutcome(UnusualTrial(cause, 1), 10.0, said, claims, fresh)


@pytest.mark.parametrize(
    ("cause", "claims", "verdict", "answer"),
    [
        ("aliasing", [effect("periodic-disturbance")], "named", Answer.RIGHT),
        ("stick-slip", [effect("coulomb-friction"), effect("delay")], "named", Answer.RIGHT),
        ("stick-slip", [effect("delay"), effect("coulomb-friction")], "named", Answer.FAMILY),
        ("stick-slip", [effect("delay", 0.9, "coulomb-friction")], "named", Answer.FAMILY),
        ("stick-slip", [effect("delay")], "named", Answer.WRONG),
        ("late-friction", [term("a1*(sign(v)) in dv/dt, from t = s1 on")], "discovered", Answer.RIGHT),
        ("late-friction", [term("a1*(sign(v)) in dv/dt, until t = s1")], "discovered", Answer.FAMILY),
        ("early-friction", [term("a1*(sign(v)) in dv/dt, until t = s1")], "discovered", Answer.RIGHT),
        ("late-friction", [term("a1*(sign(v)) in dv/dt")], "discovered", Answer.FAMILY),
        ("late-friction", [term("a1*(t*v) in dv/dt")], "discovered", Answer.WRONG),
        ("late-stiffness", [term("a1*(x**3) in dv/dt, from t = s1 on")], "discovered", Answer.RIGHT),
        ("amplitude-damping", [term("a2*u in output"), term("a1*(x**2*v) in dv/dt")], "", Answer.RIGHT),
        ("amplitude-damping", [term("a1*(v**3) in dv/dt")], "discovered", Answer.FAMILY),
        ("fading-damper", [term("a1*(t*v) in dv/dt")], "discovered", Answer.RIGHT),
        ("fading-damper", [term("a1*(v*exp(-t/s1)) in dv/dt")], "discovered", Answer.RIGHT),
        ("fading-damper", [term("a1*(t*abs(v)) in dv/dt")], "discovered", Answer.FAMILY),
        ("fading-damper", [effect("periodic-disturbance")], "named", Answer.WRONG),
        ("fifth-power", [term("a1*(x**5) in dv/dt")], "discovered", Answer.RIGHT),
        ("fifth-power", [effect("cubic-stiffness")], "named", Answer.FAMILY),
        ("warm-gain", [term("a1*(T_K*u) in output")], "discovered", Answer.RIGHT),
        ("warm-gain", [effect("input-gain-curve")], "family", Answer.FAMILY),
        ("quantised-valve", [], "unknown", Answer.UNKNOWN),
        ("quantised-valve", [], "nothing", Answer.MISSED),
        ("quantised-valve", [], "noise", Answer.MISSED),
        ("quantised-valve", [], "named", Answer.MISSED),
        ("quantised-valve", [], "named with remainder", Answer.UNKNOWN),
        ("quantised-valve", [], "error", Answer.ERROR),
        ("clean-loop", [], "nothing", Answer.RIGHT),
        ("clean-loop", [], "named", Answer.RIGHT),
        ("clean-loop", [], "unknown", Answer.UNKNOWN),
        ("clean-loop", [effect("delay", 0.3)], "named", Answer.WRONG),
    ],
)
def test_an_answer_is_judged_by_the_table_of_causes(
    cause: str, claims: list[Claim], verdict: str, answer: Answer
) -> None:
    assert classify_answer(outcome(cause, *claims, verdict=verdict)) == answer


def test_every_accepted_name_is_in_the_catalogue_or_may_be_given_later() -> None:
    families = {each.family for each in CATALOGUE.values()}
    own = {"state-clip"}  # It belongs to simulations, not to the catalogue.
    for cause in UNUSUAL_CAUSES.values():
        assert cause.names <= {*CATALOGUE, *LATER, *own}, cause.name
        assert cause.family <= {*CATALOGUE, *families}, cause.name


def test_a_cause_can_be_answered_and_a_clean_record_cannot() -> None:
    for cause in UNUSUAL_CAUSES.values():
        assert bool(cause.names or cause.terms or cause.family) != cause.is_clean, cause.name


@pytest.mark.parametrize(
    ("found", "fails"),
    [
        (outcome("stick-slip", effect("coulomb-friction"), fresh=HELD), [False]),
        (outcome("stick-slip", effect("coulomb-friction", 0.8), fresh=WORSE), []),
        (outcome("stick-slip", effect("coulomb-friction"), fresh=WORSE), [True]),
        (outcome("stick-slip", effect("coulomb-friction"), fresh=FreshErrors(10, 6, 10, 6)), [True]),
        (outcome("stick-slip", effect("coulomb-friction"), fresh=FreshErrors(10, 1, 10, 11)), [True]),
        (
            outcome("stick-slip", effect("coulomb-friction"), effect("delay", loss=0.9), fresh=HELD),
            [False, True],
        ),
        (outcome("aliasing", effect("periodic-disturbance"), effect("jump"), fresh=WORSE), [False, True]),
        (outcome("stick-slip", effect("wrong-unit"), verdict="gross error"), [True]),
        (outcome("stick-slip", effect("second-hysteresis"), verdict="gross error"), [False]),
        (outcome("clean-loop", effect("delay"), fresh=HELD), [True]),
    ],
)
def test_a_sure_claim_fails_if_the_fresh_record_refutes_it(found: UnusualOutcome, fails: list[bool]) -> None:
    assert [each.fails for each in list_sure_claims(found)] == fails


def test_scores_count_causes_claims_extensions_and_clean_records() -> None:
    outcomes = [
        outcome("stick-slip", effect("coulomb-friction"), fresh=HELD),
        outcome("stick-slip", effect("damping-curve"), fresh=FreshErrors(10.0, 3.0, 10.0, 3.0)),
        outcome("stick-slip", effect("delay"), fresh=WORSE),
        outcome("aliasing", effect("periodic-disturbance"), fresh=WORSE),
        outcome("day-wave"),
        outcome("day-wave", verdict="unknown"),
        outcome("clean-loop"),
        outcome("clean-loop", verdict="unknown"),
        outcome("clean-pink", effect("jump", 0.5), fresh=HELD),
        replace(outcome("clean-pink", fresh=WORSE), is_refused=True),
    ]
    rows = score_unusual(outcomes)
    assert {row.name: (row.count, row.of) for row in rows if isinstance(row, Proportion)} == {
        "right or family": (3, 6),
        "right": (2, 6),
        "unknown": (1, 6),
        "missed, wrong or ended by an error": (2, 6),
        "claims with a confidence of 0.9 or more that fail on a fresh record": (1, 4),
        "the same below 0.2": (1, 3),
        "extensions that make a fresh record worse or diverge": (1, 4),
        "the same, of disturbances that have another phase there": (1, 1),
        "extensions that are refused": (1, 6),
        "clean records with a name": (1, 4),
        "clean records with 'unknown'": (1, 4),
    }
    (median,) = (row for row in rows if isinstance(row, Statistic))
    assert (median.value, median.of) == (pytest.approx(0.3), 3)
    answers = count_answers(outcomes)
    assert list(answers) == ["aliasing", "stick-slip", "day-wave", "clean-pink", "clean-loop"]
    assert {answer for answer, times in answers["stick-slip"].items() if times} == {
        Answer.RIGHT,
        Answer.FAMILY,
        Answer.WRONG,
    }
