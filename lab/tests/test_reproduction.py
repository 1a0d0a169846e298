"""The command ``islands reproduce``: the page of the paper, also after an interruption."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from support.command_line import ISLANDS, succeed
from support.undrawn import undrawn_figures


def results(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "tasks").glob("*.json")}


def test_short_form_of_case_2_prints_and_writes_its_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tasks run in this process, and the figures are not laid out."""
    monkeypatch.setattr("lab.parallel_map.has_ray", lambda: False)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0})
    with undrawn_figures():
        printed = succeed("reproduce", "case2", "--quick", "--out", tmp_path)
    assert "1.01111" in printed
    assert "reproduction.html says why the numbers differ" in printed
    document = json.loads((tmp_path / "reproduction.json").read_text())
    (section,) = document.values()
    assert section["numbers"]["published"]["samples"] == 2000
    assert list(results(tmp_path)) == ["case2-published.json"]


@pytest.mark.timeout(900)
def test_interrupted_short_form_continues_with_the_same_bytes(tmp_path: Path) -> None:
    command = [ISLANDS, "reproduce", "all", "--quick", "--seeds", "1", "--runs", "1", "--out"]
    environment = {**os.environ, "COLUMNS": "200"}
    with subprocess.Popen(
        [*command, tmp_path / "stopped"], env=environment, stderr=subprocess.PIPE
    ) as stopped:
        deadline = time.monotonic() + 300
        while not results(tmp_path / "stopped") and time.monotonic() < deadline:
            time.sleep(0.2)
        stopped.send_signal(signal.SIGINT)
        assert b"repeat the command" in stopped.communicate(timeout=60)[1]
    assert stopped.returncode == 130
    first = results(tmp_path / "stopped")
    assert first
    assert not (tmp_path / "stopped" / "reproduction.html").exists()
    for name in ("stopped", "whole"):
        subprocess.run([*command, tmp_path / name], env=environment, check=True, capture_output=True)
    assert first.items() <= results(tmp_path / "stopped").items()
    files = [
        sorted(path for path in (tmp_path / name).rglob("*") if path.is_file())
        for name in ("stopped", "whole")
    ]
    assert [path.read_bytes() for path in files[0]] == [path.read_bytes() for path in files[1]]
    page = (tmp_path / "whole" / "reproduction.html").read_text()
    for published in ("0.31189", "0.25250", "1.01111", "20 of 50", "short form"):
        assert published in page
