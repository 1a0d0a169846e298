"""``islands benchmark``: the list, a run from the files to the rows, and other packages."""

import json
import subprocess
import sys

import numpy as np
import pytest

from islands.benchmarks.peers import environments
from islands.benchmarks.peers.catalogue import PEERS
from islands.benchmarks.peers.environments import PeerEnvironment
from islands.cli.commands import benchmark
from support.command_line import fail, succeed
from support.latent_systems import smooth_input
from support.peer_scripts import LEAST_SQUARES, make_peer

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


def test_the_list_says_where_data_are_and_what_is_published(folder):
    shown = succeed("benchmark", "list", "--data", folder)
    tanks, _, others = shown.partition("wiener-hammerstein\n")
    assert "origin: Schoukens" in tanks
    assert "cascaded_tanks.csv is present (SHA-256 78e9181e" in tanks
    assert "tests in V: validation (published: 0.191)" in tanks
    assert "wh2009.npz is missing (SHA-256 3e5f89a0" in others
    assert "doi 10.5281/zenodo.4445334" in others


@pytest.mark.ci
def test_a_run_has_a_row_for_each_class_and_test(folder):
    out = folder / "new" / "rows.json"
    shown = succeed(
        "benchmark", "run", "cascaded-tanks", "--data", folder, "--seeds", "2", "--budget", "1", "--json", out
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


def test_errors_come_before_the_searches(folder):
    assert "cascaded_tanks.csv" in fail("benchmark", "run", "cascaded-tanks", "--data", folder / "none")
    assert "Did you mean 'silverbox'" in fail("benchmark", "run", "silver-box", "--data", folder)
    unknown = fail("benchmark", "run", "cascaded-tanks", "--data", folder, "--model", "spline")
    assert "unknown class of models 'spline'" in unknown
    assert "no set is present" in fail("benchmark", "run", "all", "--data", folder / "none")
    assert "pip install nonlinear-benchmarks" in fail("benchmark", "run", "nonlinear_benchmarks:EMPS")


@pytest.mark.ci
def test_other_packages_have_a_row_for_each_test_with_their_cpu_time(folder, monkeypatch):
    """A small script in place of an installed package."""
    monkeypatch.setattr(benchmark, "PEERS", {"fastcan": make_peer(folder, LEAST_SQUARES)})
    python = PeerEnvironment(sys.executable, ("numpy==2",))
    monkeypatch.setattr(environments, "prepare_environment", lambda *_: python)
    out = folder / "new" / "peers.json"
    shown = succeed(
        "benchmark", "peers", "--peer", "fastcan", "--data", folder, "--limit", "60", "--json", out
    )
    document = json.loads(out.read_text())
    assert (document["limit_s"], document["packages"]) == (60.0, {"fastcan": ["numpy==2"]})
    assert document["benchmarks"]["cascaded-tanks"]["other_files"] == ["cascaded_tanks.csv"]
    (row,) = document["results"]
    assert row["error"] == pytest.approx(0.02, rel=0.1)
    assert (row["benchmark"], row["test"], row["reason"]) == ("cascaded-tanks", "validation", None)
    assert "cascaded-tanks, RMSE in V" in shown
    assert "tiny 1.2: A setting." in shown


def test_an_unknown_package_or_limit_is_an_error(folder):
    assert "unknown package 'sindy'" in fail("benchmark", "peers", "--peer", "sindy", "--data", folder)
    assert "positive number of seconds" in fail("benchmark", "peers", "--limit", "0", "--data", folder)


@pytest.mark.nightly
def test_a_package_of_the_index_is_measured(folder):
    """A lag is linear: any of the packages finds it, up to the noise of the output."""
    pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--quiet", "--dest", folder / "index"]
    peer = PEERS["fastcan"]
    answered = subprocess.run([*pip, f"{peer.package}=={peer.version}"], check=False, capture_output=True)
    if answered.returncode != 0:
        pytest.skip("the package index does not answer")
    arguments = ("--peer", "fastcan", "--environments", folder / "venv", "--json", folder / "rows.json")
    succeed("benchmark", "peers", "cascaded-tanks", "--data", folder, *arguments)
    (row,) = json.loads((folder / "rows.json").read_text())["results"]
    assert row["reason"] is None
    assert row["error"] == pytest.approx(0.02, rel=0.2)
