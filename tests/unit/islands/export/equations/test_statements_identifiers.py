"""Identifiers: different names have different identifiers, which every language accepts."""

import re

from hypothesis import given
from hypothesis import strategies as st

from islands.export.equations.statements import make_identifiers


def test_words_of_a_language_and_signs_are_replaced():
    found = make_identifiers(
        ["double", "end", "_x", "input-offset:v", "at -0.5", "at 0.5", "rate(u)", "a b", "a-b"]
    )
    assert list(found.values()) == [
        *("double_", "end_", "x", "input_offset_v", "at_m0_5", "at_0_5", "rate_u", "a_b", "a_b_2"),
    ]


@given(st.lists(st.text(max_size=80), max_size=4, unique=True))
def test_identifiers_are_valid_and_unique(names):
    found = make_identifiers(names)
    assert list(found) == names
    assert len(set(found.values())) == len(names)
    assert all(re.fullmatch(r"[A-Za-z]\w{0,62}", each, re.ASCII) for each in found.values())
