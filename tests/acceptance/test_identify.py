"""The command identify: a search, its files, an interruption and its resumption."""

import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from support.command_line import BUDGET, COLUMNS, ISLANDS, fail, found, stored, succeed, write_hysteresis
from support.processes import eventually
from support.undrawn import undrawn_figures


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of 4000 samples and what six generations make of it, the last fifth kept for a test.

    Its figures are not drawn.
    """
    base = tmp_path_factory.mktemp("hysteresis")
    write_hysteresis(base / "record.csv")
    with undrawn_figures():
        succeed(
            *("identify", base / "record.csv", *COLUMNS, *BUDGET, "--generations", 6),
            *("--test", 0.2, "--out", base / "whole"),
        )
    return base


def with_generations(document: dict[str, Any], generations: int, out: Path) -> None:
    """Give a run that has ended another last generation: its budget is not part of its random numbers."""
    document["about"]["job"]["changes"].update(generations=generations, max_evaluations=0)
    (out / "checkpoint.json").write_text(json.dumps(document))


def found_the_same(one: Path, other: Path) -> None:
    """Compare all that two runs say of their searches, except for their times."""
    assert found(one) == found(other)
    searches = [stored(out)["search"] for out in (one, other)]
    for name in ("generations", "evaluations", "duplicates", "outcomes", "feasible_share", "full_set"):
        assert searches[0][name] == searches[1][name], name
    for name in ("test.json", "figures/convergence.svg"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_one_command_turns_a_record_into_constrained_models(folder: Path) -> None:
    result = stored(folder / "whole")
    assert result["search"]["generations"] == 6
    assert result["search"]["evaluations"] == 7 * 30
    assert sum(result["search"]["outcomes"].values()) == 7 * 30
    assert 0.5 < result["search"]["feasible_share"] <= 1.0
    assert result["search"]["duplicates"] > 0
    assert result["search"]["full_set"]["bytes"] > 1e6
    assert result["record"]["samples"] == 3200
    assert all(model["physics"]["property_1"] for model in result["models"])
    best = result["models"][0]
    assert best["size"] <= 5
    assert best["metrics"]["validation"]["free_run"]["mape"] < 0.5
    tested = json.loads((folder / "whole/test.json").read_text())
    assert tested["outcome"] == "ok"
    assert tested["mape"] < 0.5


def test_the_folder_holds_models_figures_and_a_checkpoint(folder: Path) -> None:
    names = {path.name for path in (folder / "whole").iterdir()}
    assert names >= {"result.json", "summary.txt", "checkpoint.json", "hall.json", "test.json"}
    assert names >= {"models", "figures"}
    figures = {path.stem for path in (folder / "whole/figures").glob("*.svg")}
    assert figures >= {"free-run", "loop", "hold", "residuals", "convergence", "front"}
    shown = succeed("show", folder / "whole/models/01.json")
    assert shown.strip() in (folder / "whole/summary.txt").read_text()


def test_a_run_that_its_budget_ended_goes_on_to_the_same_models(folder: Path) -> None:
    out = folder / "budget"
    with undrawn_figures():
        succeed(
            *("identify", folder / "record.csv", *COLUMNS, *BUDGET, "--generations", 6),
            *("--max-evaluations", 90, "--test", 0.2, "--out", out),
        )
        assert stored(out)["search"]["ended_by"] == "evaluations"
        assert stored(out)["search"]["generations"] < 6
        with_generations(json.loads((out / "checkpoint.json").read_text()), 6, out)
        succeed("identify", "--resume", out)
    found_the_same(out, folder / "whole")


@pytest.mark.ci
def test_ctrl_c_writes_a_result_and_a_checkpoint_and_resume_goes_on_to_the_same_models(folder: Path) -> None:
    out = folder / "stopped"
    running = subprocess.Popen(
        [
            *(ISLANDS, "identify", folder / "record.csv", *COLUMNS, *BUDGET),
            *("--generations", "1000000", "--test", "0.2", "--out", out),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # The first populations are kept at once.
        eventually(lambda: (out / "checkpoint.json").exists() or running.poll() is not None)
        running.send_signal(signal.SIGINT)
        said, complained = running.communicate(timeout=60)
    finally:
        running.kill()
    assert running.returncode == 0, complained
    assert f"stopped: the result is the best so far; go on with --resume {out}" in complained
    assert "Traceback" not in complained
    assert "MAPE val. %" in said
    result, document = stored(out), json.loads((out / "checkpoint.json").read_text())
    assert result["models"]
    stopped_at = result["search"]["generations"]
    assert stopped_at == document["islands"][0]["generation"] < 1_000_000

    # Few generations more, instead of a million.
    last = stopped_at + 2
    with_generations(document, last, out)
    succeed("identify", "--resume", out)
    never = folder / "never-stopped"
    succeed(
        *("identify", folder / "record.csv", *COLUMNS, *BUDGET, "--generations", last),
        *("--test", 0.2, "--out", never),
    )
    found_the_same(out, never)


def test_a_record_that_changed_is_refused_on_resume(folder: Path) -> None:
    record, before = folder / "record.csv", (folder / "whole/result.json").read_bytes()
    kept = record.read_text()
    try:
        record.write_text(kept + "\n")
        assert "record.csv has changed since the run began" in fail("identify", "--resume", folder / "whole")
    finally:
        record.write_text(kept)
    assert (folder / "whole/result.json").read_bytes() == before


def test_a_budget_that_makes_no_sense_is_refused_in_a_line(folder: Path) -> None:
    base = ("identify", folder / "record.csv", *COLUMNS, "--out", folder / "never")
    assert fail(*base, "--population", 0).strip() == "error: population is at least 1, got 0"
    assert not (folder / "never").exists()
