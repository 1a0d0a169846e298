"""Runs whose process is killed or stopped: results are kept, and a resumed run ends in the same way."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from support.command_line import BUDGET, COLUMNS, ISLANDS, found, stored, succeed, write_hysteresis
from support.processes import actors, alive, descendants, eventually, kill
from support.undrawn import undrawn_figures

JOB = (*COLUMNS, *BUDGET, "--islands", "2", "--set", "migrate_every=1")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_hysteresis(tmp_path_factory.mktemp("house") / "record.csv")


def started(record: Path, out: Path, generations: int, *options: str) -> subprocess.Popen[str]:
    command = [ISLANDS, "identify", record, *JOB, "--generations", str(generations), "--out", out, *options]
    # A separate process group, as in a terminal: Ctrl-C reaches all of it, including Ray's processes.
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def shortened(out: Path, generations: int) -> None:
    """Reduce the budget of a run, which does not affect its random numbers."""
    path = out / "checkpoint.json"
    path.write_text(path.read_text().replace('"generations": 1000000', f'"generations": {generations}'))


def undisturbed(record: Path, generations: int) -> dict[str, bytes]:
    out = record.parent / f"undisturbed-{generations}"
    if not out.exists():
        with undrawn_figures():
            succeed(
                *("identify", record, *JOB, "--generations", generations, "--engine", "serial", "--out", out)
            )
    return found(out)


@pytest.mark.parametrize(
    "engine",
    # Some of Ray's processes notice only after a minute that their parent has ended.
    [pytest.param("serial", marks=pytest.mark.ci), pytest.param("ray", marks=pytest.mark.nightly)],
)
def test_killed_run_leaves_no_process_and_resumes_to_the_same_result(record: Path, engine: str) -> None:
    out = record.parent / f"killed-{engine}"
    running = started(record, out, 1_000_000, "--engine", engine)
    eventually((out / "checkpoint.json").exists)
    children = descendants(running.pid)
    assert bool(actors(running.pid)) == (engine == "ray")
    kill(running.pid)
    running.communicate()
    assert not (out / "result.json").exists()
    # Two of Ray's own processes check only now and then whether their parent lives.
    eventually(lambda: not alive(children), seconds=120.0)
    shortened(out, 20)
    with undrawn_figures():
        succeed("identify", "--resume", out, "--engine", engine)
    assert found(out) == undisturbed(record, 20)


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ["serial", "ray"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_stopped_run_stores_the_best_and_resumes_to_the_same_result(
    record: Path, engine: str, number: signal.Signals
) -> None:
    out = record.parent / f"{engine}-{number.name}"
    running = started(record, out, 1_000_000, "--engine", engine)
    try:
        eventually((out / "checkpoint.json").exists)
        if number == signal.SIGINT:
            os.killpg(running.pid, number)
        else:
            running.send_signal(number)
        said, complained = running.communicate(timeout=60)
    finally:
        running.kill()
    assert running.returncode == (130 if number == signal.SIGINT else 0), complained
    assert "MAPE val. %" in said
    assert f"continue with --resume {out}" in complained
    assert "Traceback" not in complained
    result = stored(out)
    assert result["search"]["ended_by"] == "stopped"
    last = result["search"]["generations"] + 2
    shortened(out, last)
    succeed("identify", "--resume", out)
    assert found(out) == undisturbed(record, last)
