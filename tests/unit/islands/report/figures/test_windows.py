"""Parts of a record that figures show: last loops and representative section."""

import numpy as np

from islands.records.dataset import Dataset
from islands.report.figures.windows import LOOPS, last_loops, representative_window


def sine(periods: int, length: int = 100, **changes: object) -> Dataset:
    k = np.arange(periods * length)
    u = np.sin(2 * np.pi * k / length - 0.5)
    return Dataset(u, 2 * u, 0.01, **changes)


def test_last_loops_are_complete_periods_at_the_end():
    rows = last_loops(sine(40))
    assert rows.stop - rows.start == 100 * LOOPS + 1
    assert rows.stop > 3900


def test_section_has_the_median_residual():
    record = sine(25)
    residual = np.repeat([5.0, 1.0, 4.0, 3.0, 2.0], 500)
    assert representative_window(record, residual) == slice(1500, 2000)
