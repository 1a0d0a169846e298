"""A masked value is a missing value, whatever leads it in."""

import numpy as np
import pytest

import islands

K = np.arange(240)
U, Y = np.sin(K / 3.0), np.cos(K / 5.0)
MASK = np.isin(K, (20, 41))
HIDDEN = np.ma.array(np.where(MASK, 0.0, Y), mask=MASK)
TABLE = np.ma.array(np.column_stack([U, np.where(MASK, 0.0, Y)]), mask=np.column_stack([0 * MASK, MASK]))
STRUCTURE = np.ma.array(
    list(map(tuple, TABLE.data)), mask=list(map(tuple, TABLE.mask)), dtype=[("u", "f8"), ("y", "f8")]
)
CHOICE = {"inputs": "u", "output": "y", "dt": 0.1}

OUTPUTS = {
    "two arrays": lambda: islands.as_record(U, HIDDEN, 0.1),
    "whole numbers": lambda: islands.as_record(U, np.ma.array(1000 * Y, mask=MASK, dtype=int), 0.1),
    "a mapping": lambda: islands.as_record({"u": U, "y": HIDDEN}, **CHOICE),
    "columns of a table": lambda: islands.as_record({"u": TABLE[:, 0], "y": TABLE[:, 1]}, **CHOICE),
    "a structured array": lambda: islands.as_record(STRUCTURE, **CHOICE),
    "a Dataset": lambda: islands.Dataset(U, HIDDEN, 0.1),
    "an inspection": lambda: islands.inspect_record(islands.Dataset(U, HIDDEN, 0.1)).record,
}


@pytest.mark.ci
@pytest.mark.parametrize("make", OUTPUTS.values(), ids=OUTPUTS)
def test_a_masked_output_is_missing(make):
    assert np.flatnonzero(np.isnan(make().y)).tolist() == [20, 41]


@pytest.mark.parametrize(
    "u", [HIDDEN, TABLE, [HIDDEN[k : k + 1] for k in K]], ids=["one", "two", "a list of masked rows"]
)
def test_a_masked_input_is_refused_as_a_missing_one(u):
    with pytest.raises(islands.RecordError, match="sample 20"):
        islands.as_record(u, U, 0.1)
    with pytest.raises(islands.RecordError, match="not finite at sample 20"):
        islands.Dataset(u, U, 0.1)


@pytest.mark.ci  # the diagnosis is imported in a second
def test_a_simulation_with_masked_samples_is_refused_as_one_with_nan():
    def simulate(u, dt, gain=1.0):
        return np.ma.masked_greater(gain * u + dt, 0.9)

    record = islands.Dataset(U, Y, 0.1)
    with pytest.raises(islands.RecordError, match="diverges"):
        islands.diagnose(record, islands.function_simulator(simulate))
    with pytest.raises(islands.RecordError, match="has gaps"):
        islands.diagnose(record, "column:run", columns={"run": HIDDEN})
