"""``islands identify`` from inside: what is kept, what is refused, and how a run stops and goes on."""

import json
import signal
import sys
from contextlib import contextmanager
from math import inf

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.evolution.archipelago import founded
from islands.evolution.engine import SerialEngine
from islands.evolution.presets import settings_of
from islands.evolution.search import State
from islands.io.checkpoints import read_checkpoint, write_checkpoint, write_hall
from islands.io.records import write_record
from islands.io.states import state_document
from islands.model.model import model_of
from islands.model.parsing import parse
from islands.simulation.predictors import free_run
from islands.validation.findings import Progress
from islands_api.cli import run as command
from islands_api.cli.app import main

SMALL = (
    "--population",
    "10",
    "--generations",
    "3",
    "--max-terms",
    "3",
    "--shooting",
    "50",
    "--max-height",
    "3",
)
#: Every generation is an epoch.
STEPWISE = (*SMALL, "--migrate-every", "1")
TWO = (*STEPWISE, "--islands", "2", "--engine", "serial")
COLUMNS = ("--input", "u_V", "--output", "y_um")
DEEPEST = settings_of("hysteresis", {"max_height": 12}).maximum_lag


def record(samples=700, seed=0, dt=0.01):
    rng = np.random.default_rng(seed)
    u, y = 0.1 * np.cumsum(rng.normal(size=samples)), np.zeros(samples)
    for k in range(3, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.3 * y[k - 1] * abs(rise)
    return Dataset(u, y + 0.001 * rng.normal(size=samples), dt, ("u_V",), "y_um")


@pytest.fixture
def run(request, monkeypatch, capsys, tmp_path):
    """Run the command in a folder that holds ``r.csv``; return exit code, standard output, standard error.

    Figures take most of a small run's time: only a test that asks for them has them.
    """
    monkeypatch.chdir(tmp_path)
    write_record(record(), "r.csv")
    if "with_figures" not in request.fixturenames:
        monkeypatch.setattr("islands.figures.gallery.FIGURES", {})
        monkeypatch.setattr("islands.figures.gallery.search_figures", lambda _findings: ())

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["islands", "identify", *map(str, arguments)])
        try:
            main()
            code = 0
        except SystemExit as stop:
            code = stop.code
        said = capsys.readouterr()
        return code, said.out, said.err.strip()

    return call


@pytest.fixture
def with_figures():
    """Ask for figures."""


@pytest.fixture
def watched(monkeypatch):
    """Do something after every epoch."""

    def by(watch):
        monkeypatch.setattr(command, "course", lambda _tell: lambda state, _settings: watch(state))

    return by


@pytest.fixture
def interrupted(watched):
    """Send signals, Ctrl-C unless told otherwise, in a generation of one's choice."""

    def in_generation(chosen, *signals):
        def watch(state):
            if state.archipelago.generation == chosen:
                for number in signals or (signal.SIGINT,):
                    signal.raise_signal(number)

        watched(watch)

    return in_generation


class Broken(SerialEngine):
    """Fails behind the epoch that ends at generation 1."""

    def run(self, problem, start, stop):
        for epoch in super().run(problem, start, stop):
            yield epoch
            if epoch.archipelago.generation == 1:
                raise OSError(28, "No space left on device")


@pytest.fixture
def engines(monkeypatch):
    """Tell which engine is asked for, at which address; all are serial ones, or what is given."""

    def table(engine):
        asked = []

        def entry(name):
            @contextmanager
            def carry_out(address, tell):
                asked.append((name, address))
                tell("[an engine] speaks")
                yield engine

            return carry_out

        monkeypatch.setattr(command, "ENGINES", {name: entry(name) for name in command.ENGINES})
        return asked

    return table


def refused(found):
    code, out, error = found
    assert code == 2, found
    assert out == ""
    assert error.startswith("error: ")
    return error


def models(folder):
    return {path.name: path.read_bytes() for path in sorted((folder / "models").iterdir())}


# A run.


def test_a_run_leaves_a_result_a_checkpoint_and_no_litter(run, with_figures, tmp_path):
    code, out, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--seed", "4")
    assert (code, error) == (0, "")
    assert "out/: result.json, models/, figures/, summary.txt" in out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "checkpoint.json",
        "figures",
        "hall.json",
        "models",
        "result.json",
        "summary.txt",
    }
    assert {"convergence.svg", "front.svg", "free-run.svg", "loop.svg", "hold.svg"} <= {
        path.name for path in (tmp_path / "out/figures").iterdir()
    }
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert (search["generations"], search["evaluations"]) == (3, 40)
    assert search["feasible_share"] == search["outcomes"]["ok"] / 40
    assert search["wall_s"] > 0
    archipelago, about = read_checkpoint(tmp_path / "out/checkpoint.json")
    assert archipelago.generation == 3
    assert about["job"]["seed"] == archipelago.islands[0].seed == 4
    assert [about["history"][at][0] for at in (0, -1)] == [0, 3]
    assert search["ended_by"] == "generations"


def test_signals_are_as_before_when_a_run_is_over(run):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out")[0] == 0
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_what_an_earlier_run_left_in_the_folder_is_not_taken_for_this_one_s(run, tmp_path):
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--test", "0.2")[0] == 0
    assert (tmp_path / "out/test.json").exists()
    assert (tmp_path / "out/hall.json").exists()
    assert "--force" in refused(run("r.csv", *COLUMNS, *SMALL, "--out", "out"))
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--force")[0] == 0
    assert not (tmp_path / "out/test.json").exists()
    code, _, error = run(
        "r.csv", *COLUMNS, *SMALL, "--out", "out", "--force", "--seed", "9", "--wall-time", "1e-9"
    )
    assert (code, error) == (
        2,
        "error: stopped before the first populations were evaluated: there is no model to keep",
    )
    assert not (tmp_path / "out/hall.json").exists()
    assert not (tmp_path / "out/checkpoint.json").exists()


def test_the_hall_of_fame_of_all_islands_stands_beside_the_checkpoint(run, tmp_path):
    assert run("r.csv", *COLUMNS, *TWO, "--out", "out")[0] == 0
    archipelago, about = read_checkpoint(tmp_path / "out/checkpoint.json")
    assert len(archipelago.islands) == 2
    write_hall(archipelago.hall, tmp_path / "expected.json")
    assert (tmp_path / "out/hall.json").read_bytes() == (tmp_path / "expected.json").read_bytes()
    best = [min(entry.fitness for entry in island.hall.entries) for island in archipelago.islands]
    assert about["history"][-1][3] == best


# Stopped and resumed.


@pytest.mark.parametrize(
    ("generation", "number", "budget"),
    [(0, signal.SIGINT, STEPWISE), (2, signal.SIGTERM, STEPWISE), (2, signal.SIGINT, TWO)],
)
def test_stopped_it_keeps_the_best_so_far_and_resume_goes_on_as_if_never_stopped(
    run, interrupted, tmp_path, generation, number, budget
):
    assert run("r.csv", *COLUMNS, *budget, "--out", "whole")[0] == 0
    interrupted(generation, number)
    code, out, error = run("r.csv", *COLUMNS, *budget, "--out", "out")
    assert code == 0
    assert error == "stopped: the result is the best so far; go on with --resume out"
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
    for document in (one, other):
        # Seconds are the machine's; what a cache took is the process's.
        for name in ("wall_s", "evaluations_per_second", "caches"):
            del document["search"][name]
    assert one == other


def test_ctrl_c_in_the_last_generation_stops_nothing(run, interrupted):
    interrupted(3)
    code, _, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out")
    assert (code, error) == (0, "")


@pytest.mark.parametrize(
    ("signals", "code"),
    [((signal.SIGINT, signal.SIGINT), 130), ((signal.SIGTERM, signal.SIGTERM), 0)],
)
def test_a_second_ctrl_c_interrupts_and_the_epochs_before_are_kept(run, interrupted, tmp_path, signals, code):
    """Whoever ends processes may send SIGTERM twice: that asks for no more than once does."""
    interrupted(1, *signals)
    before = signal.getsignal(signal.SIGINT)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[0] == code
    assert (tmp_path / "out/result.json").exists() == (code == 0)
    assert signal.getsignal(signal.SIGINT) is before
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == 1


def test_an_epoch_that_cannot_be_shown_is_kept(run, watched, tmp_path):
    def broken(state):
        if state.archipelago.generation == 2:
            raise OSError(28, "No space left on device")

    watched(broken)
    assert "No space left" in run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[2]
    archipelago, about = read_checkpoint(tmp_path / "out/checkpoint.json")
    assert archipelago.generation == about["history"][-1][0] == 2


def test_an_island_without_a_model_is_kept_as_none_and_comes_back(tmp_path):
    """JSON knows no infinity."""
    history = (
        Progress(0, 20, {}, (inf, inf)),
        Progress(1, 40, {2: 0.1 + 0.2}, (0.1 + 0.2, inf)),
        Progress(2, 60, {1: 0.0, 2: 5e-324}, (0.0, 5e-324)),
    )
    state = State(founded(2, 5), 60, 7, {"ok": 31, "diverged": 29}, history)
    about = {"job": {"seed": 5}, "wall_s": 12.5, **state_document(state)}
    assert [least for *_, least in about["history"]] == [[None, None], [0.1 + 0.2, None], [0.0, 5e-324]]
    path = tmp_path / command.CHECKPOINT
    write_checkpoint(state.archipelago, path, about)
    assert "Infinity" not in path.read_text()
    assert command.stored(tmp_path) == ({"seed": 5}, state, 12.5)


def test_an_engine_that_fails_loses_no_finished_epoch(run, engines, tmp_path):
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "whole")[0] == 0
    engines(Broken())
    assert "No space left" in run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[2]
    assert not (tmp_path / "out/result.json").exists()
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].generation == 1
    engines(SerialEngine())
    assert run("--resume", "out")[0] == 0
    assert models(tmp_path / "out") == models(tmp_path / "whole")


def test_checkpoints_are_written_while_a_search_goes_on(run, watched, monkeypatch, tmp_path):
    """Every ten seconds: by a clock on which an epoch takes six."""
    clock, found = [0.0], []
    monkeypatch.setattr(command, "monotonic", lambda: clock[0])

    def watch(state):
        clock[0] += 6.0
        path = tmp_path / "out/checkpoint.json"
        found.append(read_checkpoint(path)[0].generation if path.exists() else None)

    watched(watch)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--generations", "6", "--out", "out")[0] == 0
    # The first populations are kept at once.
    assert found == [None, 0, 0, 2, 2, 4, 4]
    assert json.loads((tmp_path / "out/checkpoint.json").read_text())["about"]["wall_s"] == 42.0


def test_checkpoints_that_take_long_are_written_less_often(run, watched, monkeypatch, tmp_path):
    """One takes a second on this clock, and an epoch ten: a twentieth of the time is every other epoch."""
    clock, written = [0.0], []
    monkeypatch.setattr(command, "monotonic", lambda: clock[0])

    def slow(archipelago, path, about):
        clock[0] += 1.0
        written.append(archipelago.generation)
        write_checkpoint(archipelago, path, about)

    monkeypatch.setattr(command, "write_checkpoint", slow)

    def watch(state):
        clock[0] += 10.0

    watched(watch)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--generations", "6", "--out", "out")[0] == 0
    assert written == [0, 3, 6, 6]


def test_the_clock_may_end_a_run(run, watched, monkeypatch, tmp_path):
    clock = [50.0]
    monkeypatch.setattr(command, "monotonic", lambda: clock[0])

    def watch(state):
        clock[0] += 6.0

    watched(watch)
    code, _, error = run("r.csv", *COLUMNS, *STEPWISE, "--out", "out", "--wall-time", "11")
    assert code == 0
    assert error.splitlines() == [
        "stopped: the result is the best so far; go on with --resume out",
        "an end by --wall-time is not reproducible: how far a search gets by then differs",
    ]
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert (search["generations"], search["ended_by"]) == (1, "stopped")
    # The seconds are counted anew: they are how long this process may take.
    assert "stopped" in run("--resume", "out", "--wall-time", "5")[2]
    assert json.loads((tmp_path / "out/result.json").read_text())["search"]["generations"] == 2
    assert run("--resume", "out")[2] == ""


def test_the_time_of_a_resumed_run_counts_that_before_it(run, interrupted, tmp_path):
    interrupted(0)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out")[0] == 0
    path = tmp_path / "out/checkpoint.json"
    document = json.loads(path.read_text())
    document["about"]["wall_s"] += 1000.0
    path.write_text(json.dumps(document))
    assert run("--resume", "out")[0] == 0
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert 1000 < search["wall_s"] < 1100
    assert 1000 < json.loads(path.read_text())["about"]["wall_s"] < search["wall_s"]
    assert search["evaluations_per_second"] == pytest.approx(40 / search["wall_s"])


def test_a_run_that_is_done_is_resumed_to_the_same_result(run, tmp_path):
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out")[0] == 0
    before = models(tmp_path / "out")
    assert run("--resume", "out")[0] == 0
    assert models(tmp_path / "out") == before


def test_it_is_resumed_from_another_folder_too(run, interrupted, tmp_path, monkeypatch):
    write_record(record(seed=1), "v.csv")
    interrupted(1)
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out", "--validation", "v.csv")[0] == 0
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert run("--resume", "../out")[0] == 0


@pytest.mark.parametrize("changed", ["r.csv", "v.csv", "t.csv"])
def test_a_file_that_changed_is_refused(run, interrupted, tmp_path, changed):
    for seed, name in enumerate(("v.csv", "t.csv"), start=1):
        write_record(record(seed=seed), name)
    interrupted(1)
    files = "--validation", "v.csv", "--test", "t.csv"
    assert run("r.csv", *COLUMNS, *STEPWISE, "--out", "out", *files)[0] == 0
    before = models(tmp_path / "out")
    with (tmp_path / changed).open("a") as stream:
        stream.write("\n")
    assert f"{changed} has changed since the run began" in refused(run("--resume", "out"))
    (tmp_path / changed).unlink()
    assert "there is no file" in refused(run("--resume", "out"))
    assert models(tmp_path / "out") == before


def test_resume_needs_a_checkpoint_of_this_command(run, tmp_path):
    assert "cannot read the checkpoint nowhere/checkpoint.json" in refused(run("--resume", "nowhere"))
    (tmp_path / "out").mkdir()
    path = tmp_path / "out/checkpoint.json"
    write_checkpoint(founded(1, 0), path, {})
    assert "no checkpoint of islands identify: KeyError('job')" in refused(run("--resume", "out"))


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
        ("--topology", "ring"),
        ("--migrate-every", "5"),
        ("--migrants", "2"),
        ("--emigrants", "front"),
        ("--replaced", "random"),
        ("--character", "plain"),
        ("--max-evaluations", "100"),
        ("--target-error", "0.5"),
    ],
)
def test_resume_takes_no_setting_else(run, more):
    assert "give nothing else" in refused(run("--resume", "out", *more))


# Engines: how a run is carried out, never what it finds.


@pytest.mark.parametrize(
    ("number", "manner", "expected"),
    [
        (1, (), ("serial", None)),
        (2, (), ("ray", None)),
        (2, ("--engine", "serial"), ("serial", None)),
        (1, ("--engine", "ray"), ("ray", None)),
        (1, ("--ray-address", "there:6379"), ("ray", "there:6379")),
    ],
)
def test_ray_carries_out_what_it_is_of_use_for_or_asked_for(run, engines, number, manner, expected):
    asked = engines(SerialEngine())
    code, _, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--islands", number, *manner)
    # What an engine has to say is said as it is.
    assert (code, error) == (0, "[an engine] speaks")
    # A run that goes on has as many islands as it began with.
    assert run("--resume", "out", *manner)[0] == 0
    assert asked == [expected] * 2


def test_islands_that_a_preset_brings_count_as_well(run, engines, monkeypatch):
    several = {"several": settings_of("hysteresis", {"islands": 2})}
    monkeypatch.setattr(sys.modules["islands.evolution.presets"], "PRESETS", several)
    asked = engines(SerialEngine())
    assert run("r.csv", *COLUMNS, *SMALL, "--preset", "several", "--out", "out")[0] == 0
    assert run("--resume", "out")[0] == 0
    assert run("r.csv", *COLUMNS, *SMALL, "--preset", "several", "--islands", "1", "--out", "one")[0] == 0
    assert asked == [("ray", None), ("ray", None), ("serial", None)]


@pytest.mark.parametrize("more", [(), ("--resume", "out")])
def test_an_address_for_the_serial_engine_is_refused_before_anything_is_done(run, tmp_path, more):
    new = () if more else ("r.csv", *COLUMNS, *SMALL, "--out", "out")
    error = refused(run(*new, *more, "--engine", "serial", "--ray-address", "there:6379"))
    assert "--ray-address goes with --engine ray: the serial engine runs in this process" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("more", [(), ("--resume", "out")])
def test_an_unknown_engine_is_refused_before_anything_is_done(run, tmp_path, more):
    new = () if more else ("r.csv", *COLUMNS, *SMALL, "--out", "out")
    message = "unknown engine 'dask': take one of serial, ray"
    assert message in refused(run(*new, *more, "--engine", "dask"))
    assert not (tmp_path / "out").exists()


def test_how_a_run_is_carried_out_may_change_when_it_goes_on(run, engines, interrupted, tmp_path):
    asked = engines(SerialEngine())
    assert run("r.csv", *COLUMNS, *TWO, "--out", "whole")[0] == 0
    interrupted(1)
    assert run("r.csv", *COLUMNS, *TWO, "--out", "out")[0] == 0
    interrupted(None)
    manner = ("--engine", "ray", "--ray-address", "there:6379", "--wall-time", "1e9", "--verbose")
    code, out, _ = run("--resume", "out", *manner)
    assert code == 0
    assert "cache of structures: " in out
    assert asked == [("serial", None), ("serial", None), ("ray", "there:6379")]
    assert models(tmp_path / "out") == models(tmp_path / "whole")


# Test data: nothing touches it.


def test_a_fraction_that_is_kept_for_the_test_changes_no_model(run, tmp_path):
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "one", "--test", "0.2")[0] == 0
    spoilt = record()
    y = spoilt.y.copy()
    y[560:] = 5.0 + 0.01 * y[560:]
    write_record(Dataset(spoilt.u, y, spoilt.dt, ("u_V",), "y_um"), "r.csv")
    code, out, _ = run("r.csv", *COLUMNS, *SMALL, "--out", "other", "--test", "0.2")
    assert code == 0
    assert models(tmp_path / "one") == models(tmp_path / "other")
    assert json.loads((tmp_path / "one/result.json").read_text())["record"]["samples"] == 560
    good, bad = (json.loads((tmp_path / name / "test.json").read_text()) for name in ("one", "other"))
    assert good["outcome"] == bad["outcome"] == "ok"
    assert good["mape"] < 1.0 < bad["mape"]
    assert f"touched by nothing before: free run ok, MAPE {bad['mape']:.4f} %" in out


def test_the_test_may_be_a_file_or_rows_of_the_record(run, tmp_path):
    write_record(record(seed=3), "t.csv")
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "file", "--test", "t.csv")[0] == 0
    code, _, _ = run("r.csv", *COLUMNS, *SMALL, "--out", "rows", "--rows", "0:500", "--test", "500:700")
    assert code == 0
    found = [json.loads((tmp_path / name / "test.json").read_text()) for name in ("file", "rows")]
    assert all(set(each) == {"outcome", "mape", "r2", "rmse", "fit_percent"} for each in found)
    assert found[0] != found[1]


def test_a_diverging_test_is_said_and_stored_as_null_never_as_a_number(tmp_path, capsys):
    class Diverging:
        best = property(lambda self: self)

        def simulate(self, tested):
            return free_run(self.model, tested)

    result = Diverging()
    result.model = model_of([(parse("y(k-1)"), 2.0)])
    command._test(result, record(), tmp_path)
    document = json.loads((tmp_path / "test.json").read_text())
    assert list(document) == ["outcome"]
    assert document["outcome"].startswith("diverged: |y| left")
    assert "MAPE" not in capsys.readouterr().out
    result.model = model_of([(parse("y(k-1)"), 1.0)])
    still = record()
    command._test(result, Dataset(still.u, np.ones(700), 0.01), tmp_path)
    document = json.loads((tmp_path / "test.json").read_text())
    assert (document["mape"], document["rmse"]) == (None, 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--test", "500:700"), "--test 500:700: say with --rows"),
        (("--rows", "0:600", "--test", "500:700"), "--test 500:700: say with --rows"),
        (
            ("--rows", "0:400", "--validation", "400:600", "--test", "500:700"),
            "samples that estimate or validate",
        ),
        (("--rows", "0:400", "--validation", "300:600"), "--validation 300:600: say with --rows"),
        (("--test", "r.csv"), "samples that estimate or validate"),
        (("--rows", "100:700", "--test", "r.csv"), "samples that estimate or validate"),
        (("--test", "nowhere.csv"), "--test nowhere.csv: give a file that exists"),
        (("--test", "1.5"), "lies between 0 and 1, got 1.5"),
        (("--test", "slow.csv"), "sampled at 0.05 s, the record at 0.01 s: resample"),
        (
            ("--rows", "0:660", "--test", "660:700", "--max-height", "12"),
            f"the test data has 40 samples and lags reach down to {DEEPEST}: give more",
        ),
    ],
)
def test_test_data_that_is_touched_or_unfit_is_refused_before_the_search(run, tmp_path, options, message):
    write_record(record(dt=0.05), "slow.csv")
    assert message in refused(run("r.csv", *COLUMNS, *SMALL, "--out", "out", *options))
    assert not (tmp_path / "out").exists()


# Budgets.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--population", "0"), "population is at least 1, got 0"),
        (("--generations", "-1"), "generations is at least 0, got -1"),
        (("--max-terms", "0"), "max_terms is at least 1, got 0"),
        (("--max-height", "-2"), "max_height is at least 0, got -2"),
        (("--shooting", "0"), "shooting is at least 1, got 0"),
        (("--preset", "quick"), "unknown preset 'quick': take one of paper-case1"),
        (("--primitive", "mul", "--primitive", "gamma"), "unknown primitive 'gamma': take one of mul"),
        (("--constraints", "physics"), "unknown constraints 'physics': take one of none, hysteresis"),
        (("--validation", "nowhere.csv"), "--validation nowhere.csv: give a file that exists"),
        (("--input", "u_mV"), "u_mV"),
        (("--islands", "0"), "islands is at least 1, got 0"),
        (("--topology", "mesh"), "unknown topology 'mesh': take one of isolated, ring"),
        (("--topology", "ring:"), "topology 'ring:': a degree from 1 to 99 goes with random-regular alone"),
        (("--islands", "2", "--topology", "1234567890>1"), "cannot read the edge '1234567890>1'"),
        (("--migrate-every", "1234567890"), "cannot read migrate_every '1234567890'"),
        (("--migrate-every", "5,"), "cannot read migrate_every '5,'"),
        (("--migrants", "-1"), "cannot read migrants '-1'"),
        (("--islands", "2", "--migrants", "301"), "301 individuals would arrive on an island of 300"),
        (("--emigrants", "worst"), "unknown emigrants 'worst': take one of best"),
        (("--replaced", "best"), "unknown replaced 'best': take one of worst"),
        (("--character", "plain", "--character", "lazy"), "unknown character 'lazy': take one of plain"),
        (("--max-evaluations", "-1"), "max_evaluations is at least 0, got -1"),
        (("--target-error", "-0.1"), "target_error is a number and not negative, got -0.1"),
        (("--target-error", "nan"), "target_error is a number and not negative, got nan"),
    ],
)
def test_a_bad_budget_is_refused_by_name_and_leaves_no_folder(run, tmp_path, options, message):
    assert message in refused(run("r.csv", *COLUMNS, "--out", "out", *options))
    assert not (tmp_path / "out").exists()


def test_what_is_missing_is_asked_for(run):
    assert "give RECORD, --input, --output and --out, or --resume DIR" in refused(
        run("r.csv", "--out", "out")
    )
    assert "there is no file nothing.csv" in refused(run("nothing.csv", *COLUMNS, "--out", "out")).replace(
        str(command.Path.cwd()) + "/", ""
    )


def test_options_reach_the_settings(run, tmp_path):
    own = ("--primitive", "mul", "--primitive", "phi1", "--constraints", "none", "--preset", "hysteresis")
    assert run("r.csv", *COLUMNS, *SMALL, *own, "--out", "out")[0] == 0
    settings = json.loads((tmp_path / "out/result.json").read_text())["settings"]
    assert settings["primitives"] == ["mul", "phi1"]
    assert (settings["constraints"], settings["preset"]) == ("none", "hysteresis")
    assert (settings["population"], settings["generations"], settings["shooting"]) == (10, 3, 50)
    assert (settings["max_terms"], settings["max_height"]) == (3, 3)


def test_options_of_islands_reach_the_settings(run, tmp_path):
    own = (
        *("--islands", "3", "--topology", "random-regular:2", "--migrate-every", "1,2:5"),
        *("--migrants", "2", "--emigrants", "front", "--replaced", "random"),
        *("--character", "explorer", "--character", "pruner"),
        *("--max-evaluations", "1000", "--target-error", "1e-9"),
    )
    assert run("r.csv", *COLUMNS, *SMALL, *own, "--engine", "serial", "--out", "out")[0] == 0
    document = json.loads((tmp_path / "out/result.json").read_text())
    assert (
        document["settings"].items()
        >= {
            "islands": 3,
            "topology": "random-regular:2",
            "migrate_every": "1,2:5",
            "migrants": "2",
            "emigrants": "front",
            "replaced": "random",
            "characters": ["explorer", "pruner"],
            "max_evaluations": 1000,
            "target_error": 1e-9,
        }.items()
    )
    assert document["search"]["evaluations"] == 3 * 40
    # Schedules and characters are read back from the checkpoint as they were given.
    assert run("--resume", "out", "--engine", "serial")[0] == 0
    assert json.loads((tmp_path / "out/result.json").read_text())["settings"] == document["settings"]


@pytest.mark.parametrize(
    ("options", "ended_by", "generations"),
    [
        (("--max-evaluations", "20"), "evaluations", 1),
        (("--max-evaluations", "21"), "evaluations", 2),
        (("--target-error", "1e3"), "target error", 0),
    ],
)
def test_a_run_ends_by_its_budget_and_says_so(run, tmp_path, options, ended_by, generations):
    code, _, error = run("r.csv", *COLUMNS, *STEPWISE, *options, "--out", "out")
    assert (code, error) == (0, "")
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert (search["ended_by"], search["generations"]) == (ended_by, generations)
    # It has ended: resumed, nothing is left to be done.
    before = models(tmp_path / "out")
    assert run("--resume", "out")[0] == 0
    search = json.loads((tmp_path / "out/result.json").read_text())["search"]
    assert (search["ended_by"], search["generations"]) == (ended_by, generations)
    assert models(tmp_path / "out") == before
