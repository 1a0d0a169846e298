"""Settings of a process: threads of numerical libraries and open files."""

import resource
from collections.abc import Iterator

import pytest

from islands import processes


def test_threads_of_the_environment_take_precedence(monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {"OMP_NUM_THREADS": "4"}
    monkeypatch.setattr(processes.os, "environ", environment)
    processes.limit_threads()
    assert environment == {**dict.fromkeys(processes.THREADS, "1"), "OMP_NUM_THREADS": "4"}


@pytest.fixture
def file_limit() -> Iterator[int]:
    """Lower the soft limit of open files; yield the hard limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
    yield hard
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_the_limit_of_open_files_is_raised_and_never_lowered(
    file_limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "_MAX_OPEN_FILES", 300)
    processes.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(processes, "_MAX_OPEN_FILES", 200)  # the limit is never lowered
    processes.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(processes, "_MAX_OPEN_FILES", 10**12)
    processes.raise_file_limit()
    assert file_limit == resource.RLIM_INFINITY or resource.getrlimit(resource.RLIMIT_NOFILE)[0] == file_limit
