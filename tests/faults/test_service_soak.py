"""A short soak test; the long one is run by hand."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support.repository import ROOT

pytestmark = pytest.mark.nightly

KILLS = 15


@pytest.mark.timeout(900)
@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_soak_with_kills_loses_duplicates_or_changes_no_job(tmp_path: Path, database: str) -> None:
    report = tmp_path / "found.json"
    done = subprocess.run(
        [
            *(sys.executable, "-m", "lab.service.soak", "--kills", str(KILLS), "--json", report),
            *("--folder", tmp_path, "--database", database),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(report.read_text())
    assert sum(found["kills"].values()) == KILLS
    assert (found["lost"], found["duplicated"], found["different"]) == (0, 0, 0)
    assert found["states"]["succeeded"] > 5
    assert "defect" not in (tmp_path / "data.log").read_text()
