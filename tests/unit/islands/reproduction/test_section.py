"""Sections of a reproduction: every row of a comparison says why the numbers differ."""

import pytest

from islands.errors import SettingsError
from islands.reproduction.section import WHY, ComparisonTable


def test_a_table_ends_with_the_reasons():
    with pytest.raises(SettingsError, match="last column"):
        ComparisonTable("sizes", (), ("quantity", "here"))


def test_a_row_has_a_cell_for_every_column():
    with pytest.raises(SettingsError, match="4 columns"):
        ComparisonTable("sizes", (("terms", "9", "7"),))
    assert ComparisonTable("sizes", (("terms", "7", "equal"),), ("quantity", "here", WHY)).rows
