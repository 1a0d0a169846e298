"""``islands serve`` in this process: the child processes, and the file limit of the API process."""

import resource
from collections.abc import Iterator
from pathlib import Path

import pytest

from islands.errors import SettingsError
from islands_api import __main__ as api_process
from islands_api.cli.commands.serve import roles
from islands_service.liveness import EVERY
from islands_service.settings import ServiceSettings, service_settings


def coordinator_timeout(folder: Path, lease: float) -> float:
    """Return the heartbeat timeout of a coordinator."""
    settings = ServiceSettings(data_dir=folder, lease=lease)
    return next(role for role in roles(settings) if role.name == "coordinator 0").patience


def test_coordinator_timeout_is_the_lease_or_several_heartbeats(
    tmp_path: Path,
) -> None:
    assert coordinator_timeout(tmp_path, 30.0) == 30.0
    assert coordinator_timeout(tmp_path, 1.0) >= 10 * EVERY


@pytest.mark.parametrize("lease", [0.4, 0.999])
def test_lease_shorter_than_a_second_is_rejected(tmp_path: Path, lease: float) -> None:
    with pytest.raises(SettingsError, match=r"setting lease \(ISLANDS_LEASE\): .*greater than or equal to 1"):
        service_settings(data_dir=tmp_path, lease=lease)


@pytest.fixture
def file_limit() -> Iterator[int]:
    """Lower the soft limit of open files; yield the hard limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
    yield hard
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_api_process_raises_its_file_limit(file_limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api_process, "_MAX_OPEN_FILES", 300)
    api_process.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(api_process, "_MAX_OPEN_FILES", 200)  # the limit is never lowered
    api_process.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(api_process, "_MAX_OPEN_FILES", 10**12)
    api_process.raise_file_limit()
    assert file_limit == resource.RLIM_INFINITY or resource.getrlimit(resource.RLIMIT_NOFILE)[0] == file_limit
