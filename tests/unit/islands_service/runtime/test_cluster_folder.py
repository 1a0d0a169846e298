"""Folder of a local Ray: other users can neither enter it nor plant one."""

import os
import subprocess
from pathlib import Path

import pytest

from islands_service.runtime import cluster as module

#: User without rights.
OTHER_USER = 65534

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="another user is only available to root")


@pytest.fixture
def parent(monkeypatch, short_folder):
    """Return a temporary folder of all users, as ``/tmp``."""
    short_folder.chmod(0o1777)
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(short_folder))
    return short_folder


@pytest.fixture
def short_folder():
    """Return a folder with the longest path below which Ray's sockets may lie."""
    folder = Path("/tmp", f"{os.getpid():x}".ljust(module._MAX_PARENT_LENGTH - len("/tmp/"), "x"))
    folder.mkdir()
    assert len(str(folder)) == module._MAX_PARENT_LENGTH
    yield folder
    module.shutil.rmtree(folder)


def as_other_user(*command: object) -> int:
    """Run a command of the system as another user and return its exit code."""
    return subprocess.run(
        list(map(str, command)),
        check=False,
        user=OTHER_USER,
        group=OTHER_USER,
        extra_groups=[],
        cwd="/",
        stderr=subprocess.DEVNULL,
    ).returncode


@pytest.mark.ci
@needs_root
def test_another_user_reaches_nothing_that_ray_writes(parent):
    before = set(Path("/dev/shm").iterdir()), set(Path("/tmp").iterdir())
    with module.cluster(None, cpus=1):
        (folder,) = parent.glob("islands-ray-*")
        assert folder.stat().st_mode & 0o777 == 0o700
        sockets = {path.name for path in folder.rglob("sockets/*")}
        assert sockets == {"plasma_store", "raylet"}
        for path in (folder, *folder.glob("*/*"), *folder.rglob("sockets/*")):
            assert as_other_user("test", "-r", path) == as_other_user("test", "-w", path) == 1, path
        (socket,) = folder.rglob("sockets/plasma_store")
        assert as_other_user("mv", socket, parent / "taken") != 0
        assert as_other_user("mv", folder, parent / "taken") != 0
        assert as_other_user("test", "-r", parent) == 0
        assert socket.exists()
        # Ray writes nothing elsewhere.
        assert {path for path in Path("/tmp").iterdir() if path.name.startswith("ray")} <= before[1]
        shared = set(Path("/dev/shm").iterdir()) - before[0]
        assert not [path for path in shared if path.stat().st_mode & 0o077]
    assert list(parent.iterdir()) == []


def test_longest_socket_path_fits(parent):
    sockets = f"/islands-ray-{8 * 'x'}/r/session_2026-11-26_12-00-00_123456_4194304/sockets/plasma_store"
    assert len(f"{parent}{sockets}") <= 107


def test_folder_of_a_killed_run_is_removed(tmp_path):
    stale, elsewhere = tmp_path / "islands-ray-stale", tmp_path / "elsewhere"
    stale.mkdir(mode=0o700)
    elsewhere.mkdir(mode=0o700)
    module._remove_stale_folders(tmp_path)
    assert list(tmp_path.iterdir()) == [elsewhere]


@pytest.mark.parametrize("owner", [pytest.param(OTHER_USER, marks=needs_root), None], ids=["other", "link"])
def test_planted_folder_is_not_opened(tmp_path, owner):
    target = tmp_path / "precious"
    target.mkdir(mode=0o700)
    planted = tmp_path / "islands-ray-planted"
    if owner is None:
        planted.symlink_to(target)
    else:
        planted.mkdir(mode=0o700)
        (planted / "lock").symlink_to(target / "created")
        os.chown(planted, owner, owner)
    module._remove_stale_folders(tmp_path)
    assert list(target.iterdir()) == []
    assert os.path.lexists(planted)


def test_open_folder_is_not_opened(tmp_path):
    """Another user may have planted its lock as a link."""
    target, planted = tmp_path / "created", tmp_path / "islands-ray-open"
    planted.mkdir()
    planted.chmod(0o777)
    (planted / "lock").symlink_to(target)
    module._remove_stale_folders(tmp_path)
    assert not target.exists()
