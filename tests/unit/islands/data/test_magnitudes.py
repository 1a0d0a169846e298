"""Magnitudes of signals that cannot be analysed are refused with the name of the column."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.data.magnitudes import check_magnitudes
from islands.errors import RecordError

WAVE = np.sin(np.arange(50.0))
RECORD = Dataset(np.column_stack([WAVE, WAVE]), WAVE, 0.1, ("u_V", "room_degC"), "y_um")


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1e101, r"column room_degC reaches 1e\+101, and 1e\+100 is the most: correct it, or"),
        (
            1e-101,
            r"column room_degC varies by 2e-101, and 1e-100 is the least: give it in a smaller unit",
        ),
    ],
)
def test_signal_beyond_the_range_is_refused_by_its_name(factor: float, message: str) -> None:
    with pytest.raises(RecordError, match=message):
        check_magnitudes(replace(RECORD, u=RECORD.u * np.array([1.0, factor])))


@pytest.mark.parametrize("factor", [1e99, 1e-99, 0.0])
def test_large_small_and_constant_signals_are_accepted(factor: float) -> None:
    output = np.where(np.arange(50) < 10, np.nan, factor * WAVE)
    check_magnitudes(replace(RECORD, u=factor * RECORD.u, y=output))
