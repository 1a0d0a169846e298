"""Levels: the smoke test of the laboratory is fast, its imports are tested in ci, all others at night."""

from pathlib import Path

import pytest

FOLDER = str(Path(__file__).parent)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if str(item.path).startswith(FOLDER) and item.path.name not in ("test_smoke.py", "test_imports.py"):
            item.add_marker("nightly")
