"""Run of ``islands identify``: stopping, checkpoints, resuming and engines."""

import json
import signal
from contextlib import contextmanager

import pytest

from islands.cli import engines
from islands.cli.runs import identify as command
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.persistence.checkpoints import read_checkpoint, write_checkpoint
from support.identify_runs import COLUMNS, SMALL, STEPWISE, TWO, Broken, models, refused

pytestmark = pytest.mark.ci

# Stopped and resumed.


@pytest.mark.parametrize(
    ("generation", "number", "budget"),
    [(0, signal.SIGINT, STEPWISE), (2, signal.SIGTERM, STEPWISE), (2, signal.SIGINT, TWO)],
)
def test_stopped_run_keeps_the_best_and_resumes_to_the_same_result(
    run, interrupted, tmp_path, generation, number, budget
):
    assert run("r.csv", *COLUMNS, *budget, "--out", "whole")[0] == 0
    interrupted(generation, number)
    code, out, error = run("r.csv", *COLUMNS, *budget, "--out", "out")
    assert code == (130 if number == signal.SIGINT else 0)
    left_out = f"search from generation {generation} to 3, estimation of further structures"
    assert error.startswith(f"stopped: out has the result so far, without {left_out}")
    assert "out/: result.json" in out
    stopped = json.loads((tmp_path / "out/result.json").read_text())
    assert stopped["search"]["generations"] == generation
    assert stopped["search"]["ended_by"] == "stopped"
    assert stopped["models"]
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == generation

    interrupted(None)
    code, _, error = run("--resume", "out", "--engine", "serial")
    assert (code, error) == (0, "")
    assert models(tmp_path / "out") == models(tmp_path / "whole")
    assert (tmp_path / "out/hall.json").read_bytes() == (tmp_path / "whole/hall.json").read_bytes()
    one, other = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("whole", "out"))
    assert stopped["search"]["left_out"]
    for document in (one, other):
        # Times depend on the machine, and cache sizes on the process.
        for name in ("wall_s", "evaluations_per_second", "caches"):
            del document["search"][name]
    assert one == other


def test_ctrl_c_in_the_last_generation_leaves_out_the_refinement(run, interrupted, tmp_path):
    interrupted(3)
    code, _, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out")
    assert code == 130
    assert error.startswith("stopped: out has the result so far, without estimation of further structures")
    assert json.loads((tmp_path / "out/result.json").read_text())["search"]["ended_by"] == "stopped"
    interrupted(None)
    assert run("--resume", "out")[0] == 0
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "whole")[0] == 0
    assert models(tmp_path / "out") == models(tmp_path / "whole")


@pytest.mark.parametrize("outputs", ["y_um", "y_um,z_um"])
def test_ctrl_c_while_the_engine_ends_keeps_the_result(run, monkeypatch, tmp_path, outputs):
    """Ray takes a second to end."""

    @contextmanager
    def ending(_name, _address, _islands, _tell):
        yield SerialEngine()
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(command, "start_engine", ending)
    rows = [line.split(",") for line in (tmp_path / "r.csv").read_text().splitlines()]
    delayed = ["z_um", "0", *(row[-1] for row in rows[1:])]
    lines = [",".join((*row, value)) for row, value in zip(rows, delayed, strict=False)]
    (tmp_path / "two.csv").write_text("\n".join(lines))
    given = ("two.csv", "--input", "u_V", "--output", outputs, *SMALL, "--constraints", "none")
    code, out, error = run(*given, "--out", "out")
    assert (code, error) == (130, "stopped: out has the result so far, which is complete")
    assert "out/: result.json" in out
    assert (tmp_path / "out/result.json").exists()


def test_failing_engine_loses_no_finished_epoch(run, engines, tmp_path):
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "whole")[0] == 0
    engines(Broken())
    assert "No space left" in run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[2]
    assert not (tmp_path / "out/result.json").exists()
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == 1
    engines(SerialEngine())
    assert run("--resume", "out")[0] == 0
    assert models(tmp_path / "out") == models(tmp_path / "whole")


def test_wall_time_ends_a_run(run, watched, monkeypatch, tmp_path):
    clock = [50.0]
    for module in (command, engines):
        monkeypatch.setattr(module, "monotonic", lambda: clock[0])

    def watch(state):
        clock[0] += 6.0

    watched(watch)
    code, _, error = run("r.csv", *COLUMNS, *STEPWISE, "--out", "out", "--wall-time", "11")
    assert code == 0
    assert error.splitlines() == [
        "stopped: the result is the best so far; continue with --resume out",
        "a result limited by --wall-time is not reproducible: it depends on the speed of the run",
    ]
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert (search["generations"], search["ended_by"]) == (1, "stopped")
    # The limit applies to each process, not to the whole run.
    assert "stopped" in run("--resume", "out", "--wall-time", "5")[2]
    assert json.loads((tmp_path / "out/result.json").read_text())["search"]["generations"] == 2
    assert run("--resume", "out")[2] == ""


def test_resume_needs_a_checkpoint_of_this_command(run, tmp_path):
    assert "cannot read the checkpoint nowhere/checkpoint.json" in refused(run("--resume", "nowhere"))
    (tmp_path / "out").mkdir()
    path = tmp_path / "out/checkpoint.json"
    write_checkpoint(empty_archipelago(1, 0), path, {})
    assert "is not a checkpoint of islands identify: KeyError('job')" in refused(run("--resume", "out"))


@pytest.mark.parametrize(
    "more",
    [
        ("r.csv",),
        ("--out", "there"),
        ("--seed", "0"),
        ("--generations", "9"),
        ("--preset", "narx"),
        ("--force",),
        ("--islands", "2"),
        ("--set", "topology=ring"),
        ("--set", "migrate_every=5"),
        ("--set", "migrants=2"),
        ("--set", "emigrants=front"),
        ("--set", "replaced=random"),
        ("--set", "characters=plain"),
        ("--set", "max_evaluations=100"),
        ("--set", "target_error=0.5"),
    ],
)
def test_resume_rejects_record_and_settings(run, more):
    assert "do not give others" in refused(run("--resume", "out", *more))


# Engines do not change the result.


@pytest.mark.parametrize(
    ("number", "words", "expected"),
    [
        (1, (), (None, None, 1)),
        (2, (), (None, None, 2)),
        (2, ("--engine", "serial"), ("serial", None, 2)),
        pytest.param(1, ("--engine", "ray"), ("ray", None, 1), marks=pytest.mark.nightly),
        (1, ("--set", "ray_address=there:6379"), (None, "there:6379", 1)),
    ],
)
def test_engine_is_chosen_by_the_options_and_the_number_of_islands(run, engines, number, words, expected):
    requested = engines(SerialEngine())
    code, _, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--islands", number, *words)
    # Messages of an engine are printed verbatim.
    assert (code, error) == (0, "[an engine] message")
    # A resumed run has the same number of islands.
    assert run("--resume", "out", *words)[0] == 0
    assert requested == [expected] * 2
