"""``islands identify`` from inside: what is kept, what is refused, and how a run stops and goes on."""

import importlib
import json
import signal
import sys

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.evolution.settings import Settings
from islands.identify import State, settings_of
from islands.io.checkpoints import SCHEMA, read_checkpoint
from islands.io.records import write_record
from islands.validation.findings import Progress
from islands_api.cli.app import main

#: The package's attribute of that name is the command's function in the table of commands' file.
command = importlib.import_module("islands_api.cli.identify")

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
        monkeypatch.setattr("islands.result.FIGURES", {})
        monkeypatch.setattr("islands.result.search_figures", lambda _findings: ())

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
def interrupted(monkeypatch):
    """Press Ctrl-C in a generation of one's choice."""

    def in_generation(chosen):
        def course(_tell):
            def watch(state, _settings):
                if state.archipelago.epoch == chosen:
                    signal.raise_signal(signal.SIGINT)

            return watch

        monkeypatch.setattr(command, "course", course)

    return in_generation


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
    assert archipelago.epoch == 3
    assert about["job"]["seed"] == archipelago.islands[0].seed == 4
    assert [generation for generation, _, _ in about["history"]] == [0, 1, 2, 3]


def test_signals_are_as_before_when_a_run_is_over(run):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out")[0] == 0
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_what_an_earlier_run_left_in_the_folder_is_not_taken_for_this_one_s(run, tmp_path):
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--test", "0.2")[0] == 0
    assert (tmp_path / "out/test.json").exists()
    assert "--force" in refused(run("r.csv", *COLUMNS, *SMALL, "--out", "out"))
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--force")[0] == 0
    assert not (tmp_path / "out/test.json").exists()


# Stopped and resumed.


@pytest.mark.parametrize("generation", [0, 2])
def test_ctrl_c_keeps_the_best_so_far_and_resume_goes_on_as_if_never_stopped(
    run, interrupted, tmp_path, generation
):
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "whole")[0] == 0
    interrupted(generation)
    code, out, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out")
    assert code == 0
    assert error == "stopped: the result is the best so far; go on with --resume out"
    assert "out/: result.json" in out
    stopped = json.loads((tmp_path / "out/result.json").read_text())
    assert stopped["search"]["generations"] == generation
    assert stopped["models"]
    assert read_checkpoint(tmp_path / "out/checkpoint.json")[0].epoch == generation

    interrupted(None)
    code, _, error = run("--resume", "out")
    assert (code, error) == (0, "")
    assert models(tmp_path / "out") == models(tmp_path / "whole")
    one, other = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("whole", "out"))
    for document in (one, other):
        # Seconds are the machine's; how many structures a cache still knew is the process's.
        for name in ("wall_s", "evaluations_per_second", "duplicates", "caches"):
            del document["search"][name]
    assert one == other


def test_ctrl_c_in_the_last_generation_stops_nothing(run, interrupted):
    interrupted(3)
    code, _, error = run("r.csv", *COLUMNS, *SMALL, "--out", "out")
    assert (code, error) == (0, "")


def test_the_time_of_a_resumed_run_counts_that_before_it(run, interrupted, tmp_path):
    interrupted(0)
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out")[0] == 0
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
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", "--validation", "v.csv")[0] == 0
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert run("--resume", "../out")[0] == 0


@pytest.mark.parametrize("changed", ["r.csv", "v.csv", "t.csv"])
def test_a_file_that_changed_is_refused(run, interrupted, tmp_path, changed):
    for seed, name in enumerate(("v.csv", "t.csv"), start=1):
        write_record(record(seed=seed), name)
    interrupted(1)
    files = "--validation", "v.csv", "--test", "t.csv"
    assert run("r.csv", *COLUMNS, *SMALL, "--out", "out", *files)[0] == 0
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
    path.write_text(json.dumps({"schema": SCHEMA, "about": {}, "epoch": 3, "islands": []}))
    assert "no checkpoint of islands identify: KeyError('history')" in refused(run("--resume", "out"))


@pytest.mark.parametrize(
    "more",
    [
        ("r.csv",),
        ("--out", "there"),
        ("--seed", "0"),
        ("--generations", "9"),
        ("--preset", "narx"),
        ("--force",),
    ],
)
def test_resume_takes_nothing_else(run, more):
    assert "give nothing else" in refused(run("--resume", "out", *more))


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
            return importlib.import_module("islands.simulation.predictors").free_run(self.model, tested)

    from islands.model.model import model_of
    from islands.model.parsing import parse

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


# Where a search stands.


def test_the_course_tells_generation_speed_time_left_and_the_best_of_every_size(monkeypatch):
    told, clock = [], iter([100.0, 104.0])
    monkeypatch.setattr(command, "monotonic", lambda: next(clock))
    watch = command.course(lambda text, share: told.append((text, share)))
    settings = Settings(population=50, generations=20)

    def state(epoch, evaluations):
        island = importlib.import_module("islands.evolution.island").Island
        hall = importlib.import_module("islands.evolution.hall_of_fame").HallOfFame()
        archipelago = State().archipelago.__class__((island(0, 0, epoch, (), (), hall),), epoch)
        return State(archipelago, evaluations, history=(Progress(epoch, evaluations, {1: 4.0, 3: 0.25}),))

    watch(state(0, 50), settings)
    watch(state(2, 150), settings)
    # The first generation compiles, so it is not counted: 100 in 4 s, and 18 generations of 50 are left.
    assert [text for text, _ in told] == [
        "generation 0/20, 0/s, RMSE by terms 1:2 3:0.5",
        "generation 2/20, 25/s, 36 s left, RMSE by terms 1:2 3:0.5",
    ]
    assert [share for _, share in told] == [0.0, 0.1]
