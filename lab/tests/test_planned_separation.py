"""Plans agree with diagnoses of simulated records, on three simulations."""

from dataclasses import replace

import pytest

from lab.diagnosis.planned_separation import EXPERIMENTS, compare, count_decided

SEEDS = range(10)


@pytest.mark.timeout(3000)
@pytest.mark.parametrize(
    ("experiment", "cause"),
    [("dc-motor", "delay"), ("second-order", "backlash"), ("bouc-wen-piezo", "exponential-creep")],
)
def test_diagnoses_separate_the_causes_that_the_plan_calls_separable(experiment: str, cause: str) -> None:
    planned = replace(EXPERIMENTS[experiment], causes=(cause,))
    ((_, _, found),) = compare(planned, "white", SEEDS)
    assert found.named >= 9
    assert found.separable > 100
    assert found.separated >= 0.9 * found.separable
    assert found.equivalent >= 0.8 * found.inseparable


@pytest.mark.timeout(3000)
def test_the_decisive_input_names_one_cause_where_the_given_one_names_two() -> None:
    before, after = count_decided(("cubic-stiffness", "even-nonlinearity"), SEEDS)
    assert before <= 2
    assert after >= 9
