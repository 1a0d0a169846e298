"""What a report says in words."""

import pytest

from islands.discrepancy.detectability import SelfTest, estimate_rate
from islands_service.reports.diagnosis_report import summarise_self_test


@pytest.mark.parametrize(("better", "said"), [(0, "of at most 0.024."), (1, "of 0.049."), (40, "of 1.")])
def test_a_few_records_cannot_show_how_rare_chance_is(better: int, said: str) -> None:
    assert said in summarise_self_test(SelfTest({}, estimate_rate(0, 40), (1 + better) / 41, {}))
