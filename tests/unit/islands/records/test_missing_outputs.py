"""Records with missing outputs keep every known sample, and no segment contains a gap."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from islands.records.dataset import Dataset, join
from islands.records.missing_outputs import skip_missing_outputs


def record(known: list[bool], start: float = 0.0) -> Dataset:
    counted = np.arange(float(len(known)))
    return Dataset(counted, np.where(known, counted, np.nan), 0.5, start=start)


@given(st.lists(st.booleans(), min_size=1).filter(any), st.lists(st.booleans(), min_size=1).filter(any))
def test_known_samples_remain_in_order_and_segments_end_at_gaps(one, other):
    joined = join((record(one, start=3.0), record(other)))
    cut = skip_missing_outputs(joined)
    assert cut.y.tolist() == [*np.flatnonzero(one), *np.flatnonzero(other)]
    assert cut.u[:, 0].tolist() == cut.y.tolist()
    assert cut.start == 3.0 + 0.5 * one.index(True)
    for begin, end in cut.bounds:
        assert np.all(np.diff(cut.y[begin:end]) == 1.0)
    for boundary in np.cumsum(cut.segments)[:-1]:
        assert cut.y[boundary] != cut.y[boundary - 1] + 1.0 or boundary == sum(one)
    assert cut.rows_by_recording == {"1": slice(0, sum(one)), "2": slice(sum(one), sum(one) + sum(other))}
