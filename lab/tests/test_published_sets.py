"""``islands benchmark``: the list, a run from the files to the rows, and other packages."""

import json
import subprocess
import sys

import numpy as np
import pytest

from lab.published_sets.peers.catalogue import PEERS
from support.command_line import succeed
from support.latent_systems import smooth_input

#: Fields of a row of the document.
FIELDS = {
    *("benchmark", "test", "metric", "unit", "model", "median", "worst", "per_seed", "published", "linear"),
    *("claimed", "coverage", "terms", "parameters", "wall_s", "is_tuned"),
}


@pytest.fixture
def folder(tmp_path):
    """A folder with a file of two lags in place of the tanks."""
    u = np.column_stack([smooth_input(1024, seed) for seed in (1, 2)])
    y = np.zeros_like(u)
    for k in range(2, len(u)):
        y[k] = 1.5 * y[k - 1] - 0.56 * y[k - 2] + 0.1 * u[k - 1]
    y += 0.02 * np.random.default_rng(3).standard_normal(y.shape)
    columns = np.column_stack([4.0 * np.arange(len(u)), u[:, 0], y[:, 0], u[:, 1], y[:, 1]])
    header = "t_s,u_est_V,y_est_V,u_val_V,y_val_V"
    np.savetxt(tmp_path / "cascaded_tanks.csv", columns, delimiter=",", header=header, comments="")
    return tmp_path


def test_a_run_has_a_row_for_each_class_and_test(folder):
    out = folder / "new" / "rows.json"
    shown = succeed(
        "benchmark", "cascaded-tanks", "--data", folder, "--seeds", "2", "--budget", "1", "--json", out
    )
    document = json.loads(out.read_text())
    assert document["budget_s"] == 1.0
    (described,) = document["benchmarks"].values()
    assert described["rule"].startswith("split and 50 initial samples")
    assert described["other_files"] == ["cascaded_tanks.csv"]
    rows = {row["model"]: row for row in document["results"]}
    assert list(rows) == ["latent", "narx", "linear"]
    assert all(set(row) == FIELDS for row in rows.values())
    assert [len(row["per_seed"]) for row in rows.values()] == [2, 1, 1]
    assert rows["linear"]["median"] == pytest.approx(0.02, rel=0.1)
    assert rows["latent"]["linear"] == rows["linear"]["median"]
    assert rows["latent"]["published"][0]["value"] == 0.191
    assert "cascaded-tanks, RMSE in V" in shown
    assert all(title in shown for title in ("claimed", "coverage"))
    assert (rows["linear"]["claimed"], rows["linear"]["coverage"]) == (None, None)
    for row in rows.values():  # a search that the budget ends has a model or a reason
        assert (row["median"] is None) == (row["per_seed"][0]["reason"] is not None)


def test_a_package_of_the_index_is_measured(folder):
    """A lag is linear: any of the packages finds it, up to the noise of the output."""
    pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--quiet", "--dest", folder / "index"]
    peer = PEERS["fastcan"]
    answered = subprocess.run([*pip, f"{peer.package}=={peer.version}"], check=False, capture_output=True)
    if answered.returncode != 0:
        pytest.skip("the package index does not answer")
    arguments = ("--peer", "fastcan", "--environments", folder / "venv", "--json", folder / "rows.json")
    succeed("benchmark", "cascaded-tanks", "--data", folder, *arguments)
    (row,) = json.loads((folder / "rows.json").read_text())["results"]
    assert row["reason"] is None
    assert row["error"] == pytest.approx(0.02, rel=0.2)
