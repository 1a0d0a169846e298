"""``islands serve`` from inside: what it runs, and what the doors see to before they open."""

import resource
from collections.abc import Iterator
from pathlib import Path

import pytest

from islands.errors import SettingsError
from islands_api import __main__ as doors
from islands_api.cli.commands.serve import roles
from islands_service.liveness import EVERY
from islands_service.settings import ServiceSettings, service_settings


def patience(folder: Path, lease: float) -> float:
    settings = ServiceSettings(data_dir=folder, lease=lease)
    return next(role for role in roles(settings) if role.name == "coordinator 0").patience


def test_a_coordinator_may_be_silent_as_long_as_its_lease_and_no_less_than_some_signs_of_life(
    tmp_path: Path,
) -> None:
    assert patience(tmp_path, 30.0) == 30.0
    assert patience(tmp_path, 1.0) >= 10 * EVERY


@pytest.mark.parametrize("lease", [0.4, 0.999])
def test_a_lease_that_no_beat_keeps_is_refused(tmp_path: Path, lease: float) -> None:
    with pytest.raises(SettingsError, match=r"setting lease \(ISLANDS_LEASE\): .*greater than or equal to 1"):
        service_settings(data_dir=tmp_path, lease=lease)


@pytest.fixture
def file_limit() -> Iterator[int]:
    """A low limit on open files, and the one that this process may give itself."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
    yield hard
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_the_doors_open_as_many_files_as_they_may(file_limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doors, "_MAX_OPEN_FILES", 300)
    doors.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(doors, "_MAX_OPEN_FILES", 200)  # never less than before
    doors.raise_file_limit()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (300, file_limit)
    monkeypatch.setattr(doors, "_MAX_OPEN_FILES", 10**12)
    doors.raise_file_limit()
    assert file_limit == resource.RLIM_INFINITY or resource.getrlimit(resource.RLIMIT_NOFILE)[0] == file_limit
