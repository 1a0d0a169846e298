"""Sentences of the diagnosis report."""

import pytest

from islands.discrepancy.detectability import SelfTest, estimate_rate
from islands_service.reports.diagnosis_report import summarise_self_test


@pytest.mark.parametrize(("better", "said"), [(0, "of at most 0.024."), (1, "of 0.049."), (40, "of 1.")])
def test_p_value_is_bounded_by_the_number_of_records(better: int, said: str) -> None:
    assert said in summarise_self_test(SelfTest({}, estimate_rate(0, 40), (1 + better) / 41, {}))
