"""Columns of two states are read as 1 and 0."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record

U = np.random.default_rng(3).integers(0, 2, 80)
Y = np.cumsum(U - 0.5)


def write(tmp_path, cells, header="t_s,heater,y"):
    rows = (f"{k / 10},{cell},{value}" for k, (cell, value) in enumerate(zip(cells, Y, strict=True)))
    path = tmp_path / "r.csv"
    path.write_text("\n".join([header, *rows]))
    return path


@pytest.mark.parametrize(
    ("one", "zero"),
    [
        *(("ON", "OFF"), ("True", "False"), ("yes", "no"), ("open", "closed"), ("Y", "N")),
        *(("EIN", "AUS"), ("WAHR", "FALSCH"), ("auf", "zu"), ("VRAI", "FAUX"), ("да", "нет")),
    ],
)
def test_the_words_of_two_states_are_read_as_1_and_0(tmp_path, one, zero):
    path = write(tmp_path, [one if state else zero for state in U])
    record = read_record(path, ["heater"], "y")
    np.testing.assert_array_equal(record.u[:, 0], U)
    note = f"column heater: {one} is read as 1, {zero} as 0"
    assert record.reading == (note,)
    assert note in preview(path).warnings


def test_missing_cells_and_numbers_may_occur_among_states(tmp_path):
    cells = ["Bad", "0", *("ON" if state else "OFF" for state in U[2:])]
    record = read_record(write(tmp_path, cells), ["heater"], "y", gaps="split")
    np.testing.assert_array_equal(record.u[:, 0], [0, *U[2:]])


@pytest.mark.parametrize("cells", [("ON", "closed"), ("ON", "2"), ("Heating", "Idle")])
def test_words_that_are_no_pair_are_refused(tmp_path, cells):
    with pytest.raises(RecordError, match="is not a number"):
        read_record(write(tmp_path, [cells[state] for state in U]), ["heater"], "y")
