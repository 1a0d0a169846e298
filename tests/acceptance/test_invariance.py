"""A fit does not depend on units, offsets, digits, rounding, the order of columns and the start of time."""

from pathlib import Path

import numpy as np
import pytest

import islands
from islands.records.dataset import Dataset
from islands.systems.bouc_wen import authors_estimation, authors_validation
from lab.fuzzing.invariance import TRANSFORMATIONS, Answer, compare, draw_case, run_case

#: Cases of the seed 0 that take a few seconds each; `lab/fuzzing/invariance.py` has others.
CASES = (3, 8, 9, 10, 11, 12, 13, 14, 17, 20, 24, 85)

#: Cases of more than eight seconds.
SLOW = (3, 10, 14, 24)


@pytest.mark.ci
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "number", [pytest.param(each, marks=pytest.mark.nightly) if each in SLOW else each for each in CASES]
)
def test_a_result_does_not_depend_on_how_a_record_is_written(number: int, tmp_path: Path) -> None:
    case = draw_case(0, number)
    difference, answers = run_case(case, tmp_path)
    assert not difference, f"{case.description}\n{answers}"


def test_the_cases_contain_every_transformation() -> None:
    assert {draw_case(0, number).transformation for number in CASES} == set(TRANSFORMATIONS)


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        (Answer("Model", (0.1, 0.2)), Answer("Model", (0.1005, 0.2)), ""),
        (Answer("Model", (0.1, 0.2)), Answer("Model", (0.102, 0.2)), "error"),
        (Answer("Model", (0.1, 0.2)), Answer("LatentModel", (0.1, 0.2)), "kind"),
        (Answer("Model", (0.1, 0.2)), Answer("RecordError"), "kind"),
        (Answer("Model", (3e-8, 2e-16)), Answer("Model", (9e-7, 1e-15)), ""),
    ],
)
def test_a_difference_is_another_kind_or_an_error_above_rounding(
    first: Answer, second: Answer, difference: str
) -> None:
    assert compare(first, second, 0.0) == difference


def _with_digits(record: Dataset, digits: int) -> Dataset:
    u, y = (
        np.array([float(f"{value:.{digits}g}") for value in values]) for values in (record.u[:, 0], record.y)
    )
    return Dataset(u, y, record.dt, record.input_names, record.output_name)


@pytest.mark.ci
@pytest.mark.timeout(900)
def test_the_record_of_the_paper_with_nine_digits_has_a_model() -> None:
    """Linear models of the free run, which are compared with it, have a pole outside of the unit circle."""
    found = islands.fit(
        _with_digits(authors_estimation(), 9), validation=_with_digits(authors_validation()[:20_000], 9)
    )
    assert found.best.model.size <= 10
    assert found.best.metrics["validation"]["free_run"].mape <= 0.088
