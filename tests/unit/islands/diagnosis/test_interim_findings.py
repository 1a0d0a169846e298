"""`InterimFindings`: a diagnosis that is stopped at any step has a result, which names the steps left out."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pytest

from islands.diagnosis import procedure
from islands.diagnosis.inference import noise_floor
from islands.diagnosis.interim_findings import (
    COMBINATIONS,
    EVIDENCE,
    EXTENSION,
    FREE_FORMS,
    GROSS_ERRORS,
    MISSING_TERMS,
    SCREENING,
    STEPS,
    InterimFindings,
)
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import CATALOGUE
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.report.documents.diagnosis_json import as_json, diagnosis_document
from islands.simulators.external import RecordedOutput
from support.simulated_records import recorded, wave

pytestmark = pytest.mark.ci

U = wave(400)
RECORD = recorded(U, 1.0 + U + 0.5 * np.random.default_rng(1).standard_normal(U.size))
EFFECTS = [CATALOGUE[name] for name in ("offset", "linear-drift", "even-nonlinearity")]


def make_interim_results() -> list[Diagnosis | None]:
    """Return what a diagnosis that is stopped before each of its calls has found, and the complete one."""
    results, interim = list[Diagnosis | None](), InterimFindings()

    def keep(_message: str, _fraction: float | None = None, /) -> None:
        results.append(interim.make_diagnosis())

    def keep_and_map(function: Callable[[Any], Any], arguments: Iterable[Any], /) -> Iterator[Any]:
        for argument in arguments:
            keep("")
            yield function(argument)

    complete = diagnose(
        RECORD, RecordedOutput("theirs", U), None, 0, keep, keep_and_map, EFFECTS, interim=interim
    )
    assert interim.make_diagnosis() is complete
    return [*results, complete]


@pytest.fixture(scope="module")
def stopped() -> Iterator[list[Diagnosis]]:
    """The results of a diagnosis that is stopped after the calibration of the simulation."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_floor, "RANDOM_FEATURES", 20)
        first, *others = make_interim_results()
        assert first is None
        yield [each for each in others if each is not None]


def test_steps_left_out_are_those_from_the_current_one_on(stopped: list[Diagnosis]) -> None:
    counts = [len(each.left_out) for each in stopped]
    assert counts == sorted(counts, reverse=True)
    first = [each.left_out[0].partition(" (")[0] for each in stopped[:-1]]
    assert list(dict.fromkeys(first)) == [
        step
        for step in STEPS
        if step in {GROSS_ERRORS, SCREENING, EVIDENCE, FREE_FORMS, MISSING_TERMS, *first}
    ]
    assert stopped[-1].left_out == ()


def test_document_and_summary_state_what_was_left_out(stopped: list[Diagnosis]) -> None:
    for each in stopped:
        assert as_json(diagnosis_document(each))
        assert diagnosis_document(each)["left_out"] == list(each.left_out)
        words = DiagnosisResult.from_diagnosis(each).summary
        assert all(step in words for step in each.left_out)
        assert ("was stopped, without" in words) == bool(each.left_out)


@pytest.mark.parametrize(
    ("function", "step"),
    [
        ("screen_effects", SCREENING),
        ("search_with_ar_noise", COMBINATIONS),
        ("assess_evidence", EVIDENCE),
        ("compare_with_free_forms", FREE_FORMS),
        ("find_missing_terms", MISSING_TERMS),
        # The alternatives that the search has found are stated.
        ("add_timing_alternatives", EXTENSION),
        ("refine_extension", EXTENSION),
    ],
)
def test_a_step_that_fails_leaves_the_findings_before_it(
    function: str, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_options: object) -> None:
        raise ZeroDivisionError("the step fails")

    monkeypatch.setattr(noise_floor, "RANDOM_FEATURES", 20)
    monkeypatch.setattr(procedure, function, fail)
    found = diagnose(RECORD, RecordedOutput("theirs", U), catalogue=EFFECTS)
    ((steps, reason),) = found.not_computed.items()
    assert steps.startswith(step)
    assert reason.startswith("ZeroDivisionError: the step fails")
    assert not found.left_out
    text = DiagnosisResult.from_diagnosis(found).summary
    assert f"Not computed: {steps}: {reason}." in text
