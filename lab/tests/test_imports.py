"""Every measurement starts: its imports are those of today's library."""

import subprocess
import sys

import pytest

from support.repository import ROOT

NAMES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for folder in ("diagnosis", "fuzzing", "inspection", "islands_on_ray", "searches", "service")
    for path in sorted((ROOT / "lab" / folder).rglob("*.py"))
]


@pytest.mark.ci
def test_every_measurement_can_be_imported() -> None:
    program = f"from importlib import import_module\nfor name in {NAMES}: import_module(name)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
