"""The command ``islands identify``: a search, its files, interrupting and resuming."""

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
    """Record of 4000 samples and the result of six generations with empty figures.

    The last fifth of the record is test data.
    """
    base = tmp_path_factory.mktemp("hysteresis")
    write_hysteresis(base / "record.csv")
    with undrawn_figures():
        succeed(
            *("identify", base / "record.csv", *COLUMNS, *BUDGET, "--generations", 6),
            *("--test", 0.2, "--figures", "all", "--out", base / "whole"),
        )
    return base


def change_generations(document: dict[str, Any], generations: int, out: Path) -> None:
    """Change the last generation of a run. Random numbers do not depend on the budget."""
    document["about"]["job"]["changes"].update(generations=generations, max_evaluations=0)
    (out / "checkpoint.json").write_text(json.dumps(document))


def assert_same_search(one: Path, other: Path) -> None:
    """Check that two runs have the same results and search statistics, except for times."""
    assert found(one) == found(other)
    searches = [stored(out)["search"] for out in (one, other)]
    for name in ("generations", "evaluations", "duplicates", "outcomes", "feasible_share", "full_set"):
        assert searches[0][name] == searches[1][name], name
    for name in ("test.json", "figures/free-run.svg"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_identify_finds_constrained_models(folder: Path) -> None:
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


def test_folder_contains_models_figures_and_a_checkpoint(folder: Path) -> None:
    names = {path.name for path in (folder / "whole").iterdir()}
    assert names >= {"result.json", "summary.txt", "method.txt", "checkpoint.json", "hall.json", "test.json"}
    assert names >= {"models", "figures"}
    figures = {path.stem for path in (folder / "whole/figures").glob("*.svg")}
    assert figures >= {"free-run", "loop", "hold", "residuals", "convergence", "front"}
    shown = succeed("show", folder / "whole/models/01.json", "--format", "latex")
    assert shown.strip() == json.loads((folder / "whole/result.json").read_text())["models"][0]["latex"]


@pytest.mark.ci
def test_run_stopped_by_ctrl_c_resumes_to_the_same_models(folder: Path) -> None:
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
        # The first populations are written immediately.
        eventually(lambda: (out / "checkpoint.json").exists() or running.poll() is not None)
        running.send_signal(signal.SIGINT)
        printed, complaints = running.communicate(timeout=60)
    finally:
        running.kill()
    assert running.returncode == 130, complaints
    assert f"stopped: {out} has the result so far, without search from generation " in complaints
    assert f"continue with --resume {out}" in complaints
    assert "Traceback" not in complaints
    assert "MAPE val. %" in printed
    result, document = stored(out), json.loads((out / "checkpoint.json").read_text())
    assert result["models"]
    stopped_at = result["search"]["generations"]
    assert stopped_at == document["islands"][0]["generation"] < 1_000_000

    # A few more generations instead of a million.
    last = stopped_at + 2
    change_generations(document, last, out)
    never = folder / "never-stopped"
    with undrawn_figures():
        succeed("identify", "--resume", out)
        succeed(
            *("identify", folder / "record.csv", *COLUMNS, *BUDGET, "--generations", last),
            *("--test", 0.2, "--out", never),
        )
    assert_same_search(out, never)


def test_changed_record_is_rejected_on_resuming(folder: Path) -> None:
    record, before = folder / "record.csv", (folder / "whole/result.json").read_bytes()
    kept = record.read_text()
    try:
        record.write_text(kept + "\n")
        assert "record.csv has changed since the run began" in fail("identify", "--resume", folder / "whole")
    finally:
        record.write_text(kept)
    assert (folder / "whole/result.json").read_bytes() == before
