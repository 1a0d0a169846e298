"""Paths of the repository and of the measured records, which are not part of it."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

#: Folder of the measured records.
RECORDS = Path(os.environ.get("ISLANDS_MEASURED_DIR", ROOT.parent / "shared" / "data"))


def measured_record(name: str) -> Path:
    """Return the path of a measured record; skip the test if it is absent."""
    file = RECORDS / name
    if not file.exists():
        pytest.skip(f"needs the measured record {name}: set ISLANDS_MEASURED_DIR to its folder")
    return file
