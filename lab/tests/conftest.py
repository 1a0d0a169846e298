"""Levels of the laboratory: the smoke test is fast, and everything that is not nightly belongs to ci."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        is_smoke = item.path.name == "test_smoke.py"
        if FOLDER in item.path.parents and not is_smoke and not item.get_closest_marker("nightly"):
            item.add_marker("ci")
