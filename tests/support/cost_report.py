"""Option ``--costs``: report wall and CPU time by folder, and the tests over the limit of their level."""

import resource
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import pytest

#: CPU times in seconds of a test without a mark, and of one of the level ci, with their fixtures.
LIMIT, CI_LIMIT = 0.5, 4.0

_spent = 0.0


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--costs", action="store_true", help="report wall and CPU time by folder")


def _cpu() -> float:
    """Return the CPU time in seconds of this process and of its ended child processes."""
    used = [resource.getrusage(scope) for scope in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def pytest_collection_finish() -> None:
    global _spent  # noqa: PLW0603 - a process runs one session
    _spent = _cpu()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Iterator[Any]:
    """Add the CPU time in seconds since the last phase to the report of a phase."""
    global _spent
    report = yield
    before, _spent = _spent, _cpu()
    report.cpu = _spent - before
    return report


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if not config.getoption("--costs"):
        return
    groups = ("", "passed", "failed", "skipped")
    phases = [report for group in groups for report in terminalreporter.getreports(group)]
    tests, limits = defaultdict(float), {}
    folders = defaultdict(lambda: [set(), 0.0, 0.0])
    for report in phases:
        folder = "/".join(report.nodeid.split("::")[0].split("/")[1:-1][:3])
        if "nightly" not in report.keywords:
            tests[report.nodeid] += report.cpu
            limits[report.nodeid] = CI_LIMIT if "ci" in report.keywords else LIMIT
        folders[folder][0].add(report.nodeid)
        folders[folder][1] += report.duration
        folders[folder][2] += report.cpu
    terminalreporter.section("costs")
    terminalreporter.line(f"{'folder':40} {'tests':>6} {'wall s':>8} {'CPU s':>8}")
    for folder, (ids, wall, cpu) in sorted(folders.items(), key=lambda item: -item[1][2]):
        terminalreporter.line(f"{folder:40} {len(ids):6} {wall:8.1f} {cpu:8.1f}")
    for test, cpu in sorted(tests.items(), key=lambda item: -item[1]):
        if cpu > limits[test]:
            terminalreporter.line(f"{cpu:6.1f} s of CPU: {test}")
