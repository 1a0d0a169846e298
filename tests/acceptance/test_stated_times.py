"""Times that the documentation states: the same everywhere, and those that a run of CI measures."""

import os
import re
from pathlib import Path

import pytest

from support.repository import ROOT

#: Largest ratio of a stated and a measured time.
TOLERANCE = 1.5

#: Seconds that the loops of ``.ci/run`` took on the machine where the stated times were measured.
SECONDS_OF_LOOPS = 1.7

#: Row of the table, and its steps in ``.ci/run``. The download of packages depends on the network.
STEPS = {
    "`make demo` after the set-up": ("demo",),
    "`make test`": ("packages of the tests", "bytecode of the tests", "make test"),
}

INSTALL = ROOT / "docs" / "getting-started" / "install.md"


def read_stated() -> dict[str, int]:
    """Return the seconds of each row of the table of times."""
    rows = re.findall(r"^\| (.*) \| (\d+) s \|$", INSTALL.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: int(seconds) for name, seconds in rows}


def read_measured(log: Path) -> dict[str, float]:
    """Return the wall time in seconds of each step of ``.ci/run``."""
    rows = re.findall(r"^(.*?) +(\d+) s wall", log.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: float(seconds) for name, seconds in rows}


def test_readme_and_help_state_the_times_of_the_installation_page() -> None:
    stated = read_stated()
    assert stated.keys() >= {*STEPS, "`make demo`"}
    demo, test = f"{stated['`make demo`']} s", f"{stated['`make test`']} s"
    for place in ("README.md", "Makefile"):
        text = (ROOT / place).read_text(encoding="utf-8")
        assert re.search(rf"make demo .*\b{demo}\b", text), place
        assert re.search(rf"make test .*\b{test}\b", text), place


@pytest.mark.ci
@pytest.mark.skipif("ISLANDS_CI_STEPS" not in os.environ, reason=".ci/run measures the times")
@pytest.mark.parametrize("row", STEPS)
def test_stated_time_is_measured_by_ci(row: str) -> None:
    """The speed of machines differs, so the measured time is also compared by that of loops."""
    measured = read_measured(Path(os.environ["ISLANDS_CI_STEPS"]))
    seconds = sum(measured[step] for step in STEPS[row])
    scaled = seconds * SECONDS_OF_LOOPS / float(os.environ["ISLANDS_CI_LOOPS"])
    stated = read_stated()[row]
    assert any(stated / TOLERANCE <= each <= stated * TOLERANCE for each in (seconds, scaled)), (
        seconds,
        scaled,
    )
