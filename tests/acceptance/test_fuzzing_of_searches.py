"""Short and extreme records are searched or refused, and the search for defects finds planted ones."""

import pytest

from lab.fuzzing import searches as fuzz_searches
from lab.fuzzing.searches import draw_case, main, run_case

#: The cases are the same at every run, and the first 34 have every ending; `make fuzz` takes others daily.
SEED = 1


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "cases", [pytest.param(34, marks=pytest.mark.ci), pytest.param(200, marks=pytest.mark.nightly)]
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
    for function in ("fit", "identify", "diagnose", "fit of several outputs"):
        for ending in ("result", "RecordError"):
            assert f"{function}: {ending} " in printed, printed


@pytest.mark.ci
@pytest.mark.parametrize("case", [4302], ids=["responses below the smallest normal number"])
def test_a_case_that_was_a_defect_ends_in_a_result(case: int) -> None:
    ending = run_case(draw_case(50, case))
    assert ending.outcome == "result", ending.reason
