"""Cursors: valid ones are decoded to their position, all others are rejected."""

import base64
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands_api.web.requests import decode_cursor


def encode(value):
    return base64.urlsafe_b64encode(json.dumps(value).encode()).decode().rstrip("=")


@pytest.mark.parametrize(
    "cursor",
    [
        "",
        "x",
        "xx",
        "!!!!",
        "Ünicode",
        encode([]),
        encode([1.0]),
        encode([1.0, "a", 2]),
        encode({"a": 1, "b": 2}),
        encode(["now", "a"]),
        encode([1.0, 7]),
        encode([1.0, ""]),
        encode([1.0, "a\0b"]),
        encode([1.0, "größe"]),
        encode([1.0, "\ud800"]),
        encode([1.0, "a" * 65]),
        encode([1.0, ["a"]]),
        encode([math.nan, "a"]),
        encode([math.inf, "a"]),
        encode([10**400, "a"]),
        encode([[1.0], "a"]),
        base64.urlsafe_b64encode(b"\xff\xfe").decode(),
    ],
)
def test_a_malformed_cursor_is_rejected(cursor):
    with pytest.raises(SettingsError, match=r"is not a cursor: send `next` of the previous page unchanged"):
        decode_cursor(cursor)


@given(st.text(max_size=200))
def test_random_text_is_decoded_or_rejected(cursor):
    try:
        created, identity = decode_cursor(cursor)
    except SettingsError:
        return
    assert math.isfinite(created)
    assert identity
