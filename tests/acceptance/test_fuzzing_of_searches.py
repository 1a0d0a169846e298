"""Short and extreme records are searched or refused, and the search for defects finds planted ones."""

import warnings
from functools import partial

import numpy as np
import pytest

from islands.errors import RecordError
from lab.fuzzing import searches as fuzz_searches
from lab.fuzzing.searches import Case, draw_case, main, run_case

#: The cases are the same at every run; `make fuzz` takes others every day.
SEED = 1


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "cases", [pytest.param(16, marks=pytest.mark.ci), pytest.param(200, marks=pytest.mark.nightly)]
)
def test_every_search_of_a_short_or_extreme_record_ends_in_a_result_or_in_words(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, cases: int
) -> None:
    """Libraries and presets are given: their choice by trials takes seconds, and `make fuzz` has it."""
    monkeypatch.setattr(fuzz_searches, "_AUTO", 0.0)
    status = main(["--cases", str(cases), "--seed", str(SEED)])
    printed = capsys.readouterr().out
    assert status == 0, printed
    assert f"{cases} cases, 0 defects" in printed
    for function in ("fit", "identify", "diagnose", "fit_coupled"):
        for ending in ("result", "RecordError"):
            assert f"{function}: {ending} " in printed, printed


@pytest.mark.ci
@pytest.mark.parametrize("case", [4302], ids=["responses below the smallest normal number"])
def test_a_case_that_was_a_defect_ends_in_a_result(case: int) -> None:
    ending = run_case(draw_case(50, case))
    assert ending.outcome == "result", ending.reason


def test_a_case_is_the_same_at_every_run() -> None:
    described = [draw_case(SEED, number).description for number in range(60)]
    assert described == [draw_case(SEED, number).description for number in range(60)]
    assert len(set(described)) == 60


def _refuse(message: str) -> None:
    raise RecordError(message)


def _stop_with_traceback() -> None:
    raise ZeroDivisionError("planted")


def _loop() -> None:
    while True:
        sum(range(1000))


@pytest.mark.parametrize(
    ("run", "outcome", "reason"),
    [
        (partial(_refuse, "give a longer record"), "RecordError", "give a longer record"),
        (partial(_refuse, ""), "defect", "the message of the error is empty"),
        (_stop_with_traceback, "defect", "ZeroDivisionError: planted"),
        (lambda: np.array([1e300]) ** 2, "defect", "overflow encountered"),
        (lambda: warnings.warn("planted", stacklevel=1), "defect", "planted"),
        (_loop, "defect", "it takes more than 0.2 s of CPU"),
    ],
)
def test_another_ending_than_a_result_or_a_refusal_is_a_defect(
    monkeypatch: pytest.MonkeyPatch, run: object, outcome: str, reason: str
) -> None:
    monkeypatch.setattr(fuzz_searches, "SLOW", 0.2)
    ending = run_case(Case("fit", "planted", run))  # type: ignore[arg-type]
    assert ending.outcome == outcome
    assert reason in ending.reason
