"""Scores of trials with unusual causes: answers, claims that fail on a fresh record, and extensions."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from islands.effects.catalogue import CATALOGUE
from lab.diagnosis.injection.unusual.cause import UnusualCause
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES
from lab.diagnosis.scoring import SURE, Proportion, Statistic
from lab.diagnosis.unusual_trial import Claim, UnusualOutcome

#: Part of the error on a fresh record that an extension may leave, for its claims to hold.
HELD_RATIO = 0.5

#: Ratio of the errors on a fresh record of an extension that explains a cause.
EXPLAINED_RATIO = 0.2

#: Goals in percent, and of the median ratio: right or family, missed or wrong, failing claims, explained,
#: extensions that make a record worse, and clean records with a name and with "unknown".
_RIGHT, _WRONG, _FAILED, _EXPLAINED, _WORSE, _NAMED, _UNKNOWN = 92.0, 3.0, 5.0, 80.0, 0.0, 1.0, 2.0
_MEDIAN_RATIO = 1.0 / 30.0

#: Verdicts that say that there is no discrepancy, if nothing is claimed.
_NO_DISCREPANCY = ("nothing", "noise", "named")


class Answer(StrEnum):
    """What a diagnosis says about a cause."""

    RIGHT = "right"
    FAMILY = "family"
    UNKNOWN = "unknown"
    MISSED = "missed"
    WRONG = "wrong"
    ERROR = "error"


def classify_answer(outcome: UnusualOutcome) -> Answer:
    """Return what the claims of an outcome say about its cause.

    A first claim that is the cause is right; of several discovered terms, which have no order, one has to be.
    A claim of the family of the cause, or an equivalent of a claim, makes an answer of the family. On a clean
    record no claim is right.
    """
    cause = UNUSUAL_CAUSES[outcome.trial.cause]
    if outcome.verdict == "error":
        return Answer.ERROR
    if not outcome.claims:
        if outcome.verdict not in _NO_DISCREPANCY:
            return Answer.UNKNOWN
        return Answer.RIGHT if cause.is_clean else Answer.MISSED
    leading = [each for each in outcome.claims if each.term] if outcome.claims[0].term else outcome.claims[:1]
    if any(_is_cause(each, cause) for each in leading):
        return Answer.RIGHT
    return Answer.FAMILY if any(_is_family(each, cause) for each in outcome.claims) else Answer.WRONG


def _is_cause(claim: Claim, cause: UnusualCause) -> bool:
    if claim.term:
        law = cause.terms
        return bool(law) and re.search(law, claim.term) is not None
    return claim.name in cause.names


def _is_family(claim: Claim, cause: UnusualCause) -> bool:
    if _is_cause(claim, cause):
        return True
    if claim.term:
        law = cause.family_terms
        return bool(law) and re.search(law, claim.term) is not None
    names = {claim.name, *claim.equivalents}
    families = {CATALOGUE[name].family for name in names if name in CATALOGUE}
    return bool((names | families) & (cause.family | cause.names))


@dataclass(frozen=True, slots=True)
class SureClaim:
    """A claim with a confidence of at least `SURE`, and whether it fails on a fresh record."""

    outcome: UnusualOutcome
    claim: Claim
    fails: bool


def list_sure_claims(outcome: UnusualOutcome) -> tuple[SureClaim, ...]:
    """Return the claims of high confidence of an outcome.

    A claim fails on a fresh record if the extension diverges there or leaves more than `HELD_RATIO` of the
    error, or if it is better without this claim. If the cause is a disturbance that has another phase there,
    a right answer holds. A claim about a clean record fails, and so does a wrong one without an extension.
    """
    cause, answer = UNUSUAL_CAUSES[outcome.trial.cause], classify_answer(outcome)

    def fails(claim: Claim) -> bool:
        if cause.is_clean:
            return True
        if not cause.carries and _is_cause(claim, cause):
            return False
        if outcome.fresh is None:
            return answer == Answer.WRONG
        is_superfluous = claim.loss is not None and claim.loss < 1.0
        return outcome.fresh.ratio > HELD_RATIO or outcome.fresh.is_worse or is_superfluous

    return tuple(SureClaim(outcome, each, fails(each)) for each in outcome.claims if each.confidence >= SURE)


def score_unusual(outcomes: Sequence[UnusualOutcome]) -> list[Proportion | Statistic]:
    """Score trials against the goals."""
    caused, clean = (
        [each for each in outcomes if UNUSUAL_CAUSES[each.trial.cause].is_clean == is_clean]
        for is_clean in (False, True)
    )

    def count(
        name: str, of: Sequence[UnusualOutcome], which: tuple[Answer, ...], goal: float | None, most: bool
    ) -> Proportion:
        return Proportion(name, sum(classify_answer(each) in which for each in of), len(of), goal, most)

    return [
        count("right or family", caused, (Answer.RIGHT, Answer.FAMILY), _RIGHT, False),
        count("right", caused, (Answer.RIGHT,), None, False),
        count("unknown", caused, (Answer.UNKNOWN,), None, False),
        count(
            "missed, wrong or ended by an error",
            caused,
            (Answer.MISSED, Answer.WRONG, Answer.ERROR),
            _WRONG,
            True,
        ),
        *_score_fresh(outcomes),
        count("clean records with a name", clean, (Answer.WRONG,), _NAMED, True),
        count("clean records with 'unknown'", clean, (Answer.UNKNOWN,), _UNKNOWN, True),
    ]


def _score_fresh(outcomes: Sequence[UnusualOutcome]) -> list[Proportion | Statistic]:
    """Score claims and extensions on fresh records.

    Ratios of the errors are those of causes whose extension can hold there. Extensions of disturbances that
    have another phase there are counted apart, and those that are not offered make no record worse.
    """
    sure = [claim for each in outcomes for claim in list_sure_claims(each)]
    extended = [
        (UNUSUAL_CAUSES[each.trial.cause], each.fresh, each.is_refused)
        for each in outcomes
        if each.fresh is not None
    ]
    offered = [(cause, fresh) for cause, fresh, is_refused in extended if not is_refused]
    carried = [fresh for cause, fresh in offered if cause.carries]
    disturbed = [fresh for cause, fresh in offered if not cause.carries]
    ratios = [fresh.ratio for cause, fresh in offered if cause.carries and not cause.is_clean]
    worse = "extensions that make a fresh record worse or diverge"
    return [
        Proportion(
            f"claims with a confidence of {SURE:g} or more that fail on a fresh record",
            sum(each.fails for each in sure),
            len(sure),
            _FAILED,
            True,
        ),
        Statistic(
            "error on a fresh record, extended / simulation, median",
            float(np.median(ratios)) if ratios else float("nan"),
            len(ratios),
            _MEDIAN_RATIO,
            True,
        ),
        Proportion(
            f"the same below {EXPLAINED_RATIO:g}",
            sum(each < EXPLAINED_RATIO for each in ratios),
            len(ratios),
            _EXPLAINED,
        ),
        Proportion(worse, sum(each.is_worse for each in carried), len(carried), _WORSE, True),
        Proportion(
            "the same, of disturbances that have another phase there",
            sum(each.is_worse for each in disturbed),
            len(disturbed),
        ),
        Proportion("extensions that are refused", sum(refused for *_, refused in extended), len(extended)),
    ]


def count_answers(outcomes: Sequence[UnusualOutcome]) -> dict[str, dict[Answer, int]]:
    """Return how often each answer was given, by cause in the order of the table."""
    counts = {name: dict.fromkeys(Answer, 0) for name in UNUSUAL_CAUSES}
    for each in outcomes:
        counts[each.trial.cause][classify_answer(each)] += 1
    return {name: answers for name, answers in counts.items() if any(answers.values())}
