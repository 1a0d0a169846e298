"""Magnitudes that overflow or underflow are refused before a search, with a sentence that says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.magnitudes import LARGEST, SMALLEST, check_magnitudes

SINE = np.sin(0.3 * np.arange(100))
RECORD = Dataset(np.column_stack([SINE, SINE**2]), np.cos(SINE), 0.01, ("u_V", "v_V"), "y_um")


@pytest.mark.parametrize("name", ["u_V", "v_V", "y_um"])
@pytest.mark.parametrize("factor", [1e300, 1e40, 1e-40, 1e-310])
def test_a_signal_out_of_range_is_named(name: str, factor: float) -> None:
    u = RECORD.u * np.where(np.array(RECORD.input_names) == name, factor, 1.0)
    scaled = replace(RECORD, u=u, y=RECORD.y * (factor if name == "y_um" else 1.0))
    with pytest.raises(RecordError, match=rf"^{name} has .* use another unit"):
        check_magnitudes(scaled, RECORD)


@pytest.mark.parametrize("dt", [1e-40, 1e40])
def test_a_sampling_time_out_of_range_is_refused(dt: float) -> None:
    with pytest.raises(RecordError, match="correct the time"):
        check_magnitudes(replace(RECORD, dt=dt), replace(RECORD, dt=dt))


def test_the_limits_zeros_missing_outputs_and_the_end_of_a_decay_are_accepted() -> None:
    for scale in (0.0, LARGEST, SMALLEST):
        check_magnitudes(replace(RECORD, u=np.full((100, 2), scale)), RECORD)
    check_magnitudes(replace(RECORD, y=np.full(100, np.nan)), RECORD)
    check_magnitudes(RECORD, replace(RECORD, u=1e-300 * RECORD.u, y=1e-300 * RECORD.y))
