"""Cursors: what a client hands back is what it was given, or it is refused."""

import base64
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands_api.web.requests import decode_cursor, encode_cursor

IDENTITIES = st.from_regex(r"\A[0-9A-Za-z_-]{1,64}\Z")


@given(st.floats(allow_nan=False, allow_infinity=False), IDENTITIES)
def test_a_cursor_is_read_as_it_was_written(created, identity):
    cursor = encode_cursor((created, identity))
    assert len(cursor) <= 200
    assert decode_cursor(cursor) == (created, identity)


def test_no_place_is_no_cursor():
    assert encode_cursor(None) is None
    assert decode_cursor(None) is None


def encoded(value):
    return base64.urlsafe_b64encode(json.dumps(value).encode()).decode().rstrip("=")


@pytest.mark.parametrize(
    "cursor",
    [
        "",
        "x",
        "xx",
        "!!!!",
        "Ünicode",
        encoded([]),
        encoded([1.0]),
        encoded([1.0, "a", 2]),
        encoded({"a": 1, "b": 2}),
        encoded(["now", "a"]),
        encoded([1.0, 7]),
        encoded([1.0, ""]),
        encoded([1.0, "a\0b"]),
        encoded([1.0, "größe"]),
        encoded([1.0, "\ud800"]),
        encoded([1.0, "a" * 65]),
        encoded([1.0, ["a"]]),
        encoded([math.nan, "a"]),
        encoded([math.inf, "a"]),
        encoded([10**400, "a"]),
        encoded([[1.0], "a"]),
        base64.urlsafe_b64encode(b"\xff\xfe").decode(),
    ],
)
def test_what_is_no_cursor_of_ours_is_refused(cursor):
    with pytest.raises(SettingsError, match=r"is not a cursor: send `next` of the previous page unchanged"):
        decode_cursor(cursor)


@given(st.text(max_size=200))
def test_garbage_is_a_place_or_refused_and_nothing_else(cursor):
    try:
        created, identity = decode_cursor(cursor)
    except SettingsError:
        return
    assert math.isfinite(created)
    assert identity
