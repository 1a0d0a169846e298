"""Run of ``islands identify``: stopping, checkpoints, resuming and engines."""

import json
import signal
from contextlib import contextmanager
from math import inf

import pytest

from islands.cli.runs import identify as command
from islands.cli.runs import timed_engine
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.persistence.checkpoints import read_checkpoint, state_document, write_checkpoint
from islands.records.writer import write_record
from support.identify_runs import COLUMNS, SMALL, STEPWISE, TWO, Broken, models, record, refused

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


@pytest.mark.parametrize(
    ("signals", "code"),
    [((signal.SIGINT, signal.SIGINT), 130), ((signal.SIGTERM, signal.SIGTERM), 0)],
)
def test_second_ctrl_c_interrupts_and_keeps_finished_epochs(run, interrupted, tmp_path, signals, code):
    """A second SIGTERM has no further effect: process managers may send it twice."""
    interrupted(1, *signals)
    before = signal.getsignal(signal.SIGINT)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[0] == code
    assert (tmp_path / "out/result.json").exists() == (code == 0)
    assert signal.getsignal(signal.SIGINT) is before
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == 1


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


def test_epoch_is_kept_if_its_display_fails(run, watched, tmp_path):
    def broken(state):
        if state.archipelago.generation == 2:
            raise OSError(28, "No space left on device")

    watched(broken)
    assert "No space left" in run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[2]
    archipelago, about = read_checkpoint(tmp_path / "out/checkpoint.json")
    assert archipelago.generation == about["history"][-1][0] == 2


def test_infinite_fitness_is_stored_as_null_and_restored(tmp_path):
    """JSON has no infinity."""
    history = (
        HistoryPoint(0, 20, {}, (inf, inf)),
        HistoryPoint(1, 40, {2: 0.1 + 0.2}, (0.1 + 0.2, inf)),
        HistoryPoint(2, 60, {1: 0.0, 2: 5e-324}, (0.0, 5e-324)),
    )
    state = SearchState(empty_archipelago(2, 5), 60, 7, {"ok": 31, "diverged": 29}, history)
    header = {"job": {"seed": 5}, "wall_s": 12.5, **state_document(state)}
    assert [least for *_, least in header["history"]] == [[None, None], [0.1 + 0.2, None], [0.0, 5e-324]]
    path = tmp_path / command.CHECKPOINT
    write_checkpoint(state.archipelago, path, header)
    assert "Infinity" not in path.read_text()
    assert command.load_run(tmp_path) == ({"seed": 5}, state, 12.5)


def test_failing_engine_loses_no_finished_epoch(run, engines, tmp_path):
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "whole")[0] == 0
    engines(Broken())
    assert "No space left" in run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[2]
    assert not (tmp_path / "out/result.json").exists()
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == 1
    engines(SerialEngine())
    assert run("--resume", "out")[0] == 0
    assert models(tmp_path / "out") == models(tmp_path / "whole")


def test_checkpoints_are_written_every_ten_seconds(run, watched, monkeypatch, tmp_path):
    """An epoch takes six seconds of the replaced clock."""
    clock, found = [0.0], []
    for module in (command, timed_engine):
        monkeypatch.setattr(module, "monotonic", lambda: clock[0])

    def watch(state):
        clock[0] += 6.0
        path = tmp_path / "out/checkpoint.json"
        found.append(read_checkpoint(path)[0].generation if path.exists() else None)

    watched(watch)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--generations", "6", "--out", "out")[0] == 0
    # The first populations are written immediately.
    assert found == [None, 0, 0, 2, 2, 4, 4]
    assert json.loads((tmp_path / "out/checkpoint.json").read_text())["about"]["wall_s"] == 42.0


def test_wall_time_ends_a_run(run, watched, monkeypatch, tmp_path):
    clock = [50.0]
    for module in (command, timed_engine):
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


def test_wall_time_of_a_resumed_run_includes_earlier_processes(run, interrupted, tmp_path):
    interrupted(0)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[0] == 130
    path = tmp_path / "out/checkpoint.json"
    document = json.loads(path.read_text())
    document["about"]["wall_s"] += 1000.0
    path.write_text(json.dumps(document))
    assert run("--resume", "out")[0] == 0
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert 1000 < search["wall_s"] < 1100
    assert 1000 < json.loads(path.read_text())["about"]["wall_s"] < search["wall_s"]
    assert search["evaluations_per_second"] == pytest.approx(40 / search["wall_s"])


def test_run_can_be_resumed_from_another_folder(run, interrupted, tmp_path, monkeypatch):
    write_record(record(seed=1), "v.csv")
    interrupted(1)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out", "--validation", "v.csv")[0] == 130
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert run("--resume", "../out")[0] == 0


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


def test_engine_may_change_on_resuming(run, engines, interrupted, tmp_path):
    requested = engines(SerialEngine())
    assert run("r.csv", *COLUMNS, *TWO, "--out", "whole")[0] == 0
    interrupted(1)
    assert run("r.csv", *COLUMNS, *TWO, "--out", "out")[0] == 130
    interrupted(None)
    words = (
        "--engine",
        "ray",
        "--set",
        "ray_address=there:6379",
        "--wall-time",
        "1e9",
        "--set",
        "verbose=true",
    )
    code, out, _ = run("--resume", "out", *words)
    assert code == 0
    assert "cache of structures: " in out
    assert requested == [("serial", None, 2), ("serial", None, 2), ("ray", "there:6379", 2)]
    assert models(tmp_path / "out") == models(tmp_path / "whole")
