"""Table of structures: equal terms have one row, whatever the width of the arrays that they come from."""

import numpy as np

from islands.evolution.structure_table import UNKNOWN, StructureTable
from islands.kernels.population import SelectedTerms


def selected(*structures, width):
    terms = np.full((len(structures), width), 99)
    for row, structure in zip(terms, structures, strict=True):
        row[: len(structure)] = structure
    return SelectedTerms(terms, np.array([len(each) for each in structures]))


def test_equal_structures_have_one_number_at_any_width():
    table = StructureTable()
    assert table.number(selected((3, 1), (), (1, 3), (3, 1), width=2)) == [0, 1, 2, 0]
    assert table.number(selected((1, 3), (3, 1, 4), (), width=5)) == [2, 3, 1]
    terms, lengths = table.select(np.array([3, 0, 1]))
    assert [row[:length].tolist() for row, length in zip(terms, lengths, strict=True)] == [
        [3, 1, 4],
        [3, 1],
        [],
    ]
    # No mark of an absent term is a term, nor the mark of a gene that is zero.
    assert set(terms[:, 3:].ravel()) == {-2}


def test_table_keeps_its_rows_when_it_grows():
    table = StructureTable()
    table.number(selected((7, 8), width=2))
    table.theta[0], table.fitness[0], table.status[0] = (0.5, 0.25), 2.0, 0
    assert table.number(selected(*((1, 2, each) for each in range(300)), width=3)) == list(range(1, 301))
    assert (table.theta[0].tolist(), table.fitness[0], table.status[0]) == ([0.5, 0.25, 0.0], 2.0, 0)
    assert set(table.status[1:]) == {UNKNOWN}
    assert table.terms[300].tolist() == [1, 2, 299]
    assert len(table) == 301
