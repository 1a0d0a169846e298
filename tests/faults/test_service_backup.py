"""Backup of a running service, its destruction, and its restoration: no job is lost."""

import shutil
import subprocess
from pathlib import Path

import pytest

from support.command_line import ISLANDS
from support.processes import alive, descendants, eventually, kill
from support.service_processes import serving

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(300)]

#: Generations of a job of some seconds.
GENERATIONS = 300


def admin(*arguments: object) -> str:
    done = subprocess.run(
        [ISLANDS, "admin", *map(str, arguments)], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_destroyed_service_continues_from_its_backup(tmp_path: Path) -> None:
    with serving(tmp_path / "first") as service:
        finished, running = service.submit(5), service.submit(GENERATIONS)
        models = service.found(finished)
        service.under_way(running, 50)
        assert "2 jobs, 1 data sets" in admin("backup", tmp_path / "backup", "--data-dir", service.folder)
        reached = service.generation(running)
        children = descendants(service.process.pid)
        kill(service.process.pid)
        eventually(lambda: not alive(children), seconds=60.0)
    shutil.rmtree(tmp_path / "first")
    assert "is complete: 2 jobs" in admin("backup", "--verify", tmp_path / "backup")
    admin("backup", "--restore", tmp_path / "backup", "--data-dir", tmp_path / "second")
    with serving(tmp_path / "second") as service:
        assert service.models(finished) == models
        again = service.job(running)
        assert again["state"] in ("queued", "running")
        assert (again["progress"] or {})["generation"] <= reached + 100
        restored = service.found(running)
        assert service.job(running)["attempt"] > 1
        service._dataset = again["spec"]["dataset"]
        assert service.found(service.submit(GENERATIONS)) == restored
