"""``islands serve`` in this process: the child processes, and the file limit of the API process."""

from pathlib import Path

import pytest

from islands.errors import SettingsError
from islands_api.cli.commands.serve import roles
from islands_service.intake.confined_process import ENVIRONMENT
from islands_service.liveness import EVERY
from islands_service.settings import ServiceSettings, service_settings


def coordinator_timeout(folder: Path, lease: float) -> float:
    """Return the heartbeat timeout of a coordinator."""
    settings = ServiceSettings(data_dir=folder, lease=lease)
    return next(role for role in roles(settings, 3, 4) if role.name == "coordinator 0").patience


def test_coordinator_timeout_is_the_lease_or_several_heartbeats(
    tmp_path: Path,
) -> None:
    assert coordinator_timeout(tmp_path, 30.0) == 30.0
    assert coordinator_timeout(tmp_path, 1.0) >= 10 * EVERY


@pytest.mark.parametrize("lease", [0.4, 0.999])
def test_lease_shorter_than_a_second_is_rejected(tmp_path: Path, lease: float) -> None:
    with pytest.raises(SettingsError, match=r"setting lease \(ISLANDS_LEASE\): .*greater than or equal to 1"):
        service_settings(data_dir=tmp_path, lease=lease)


def test_the_reader_of_files_has_no_settings_of_the_service(tmp_path: Path) -> None:
    """A file may make it execute code, and the settings contain secrets."""
    (reader,) = [role for role in roles(ServiceSettings(data_dir=tmp_path), 3, 4) if role.name == "reader"]
    assert reader.environment == ENVIRONMENT
    assert reader.descriptors == {"ISLANDS_READERS": 3}
