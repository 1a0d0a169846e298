"""Disks of a few megabytes that a test can fill."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def mounted(folder: Path, size: int, **options: object) -> Iterator[Path]:
    """Mount a disk of ``size`` bytes at a new folder; skip the test if mounting is impossible."""
    if os.getuid() != 0 or shutil.which("mount") is None:
        pytest.skip("mounting a small disk requires root: run these tests as root")
    folder.mkdir()
    settings = ",".join(f"{name}={value}" for name, value in {"size": size, **options}.items())
    command = ["mount", "-t", "tmpfs", "-o", settings, "islands-test", folder]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"no small disk can be mounted here: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@contextmanager
def read_only(disk: Path) -> Iterator[None]:
    """Make a mounted disk read-only while the block runs, as Linux does after an error of the disk."""
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    try:
        yield
    finally:
        subprocess.run(["mount", "-o", "remount,rw", disk], check=True)


def filled(disk: Path, leave: int = 0) -> Path:
    """Fill a disk except for ``leave`` bytes; return the file that fills it."""
    path = disk / "filler"
    with path.open("wb", buffering=0) as stream:
        free = os.statvfs(disk)
        stream.write(bytes(max(free.f_bavail * free.f_frsize - leave, 0)))
        try:
            while leave == 0:
                stream.write(bytes(4096))
        except OSError:
            pass
    return path
