"""Levels of the cases of a parametrised test: a few at the level of the test, the others at night."""

from collections.abc import Iterable
from typing import Any

import pytest


def nightly_but(kept: Iterable[Any], values: Iterable[Any]) -> list[Any]:
    """Return values of a parameter, or tuples of several ones, marked nightly but for the kept ones."""
    kept = list(kept)
    return [
        value
        if value in kept
        else pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.nightly)
        for value in values
    ]
