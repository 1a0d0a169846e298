"""Table of the peers: scripts that can be read, and packages that this project does not need."""

import ast
import tomllib

import pytest

from islands.benchmarks.peers.catalogue import PEERS
from support.repository import ROOT


@pytest.mark.parametrize("name", PEERS)
def test_a_script_has_the_functions_that_a_child_process_calls(name):
    tree = ast.parse(PEERS[name].script.read_text(encoding="utf-8"))
    functions = {
        node.name: [each.arg for each in node.args.args]
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
    }
    assert functions["fit"] == ["recordings", "candidate", "task"]
    assert len(functions["list_candidates"]) == 1


@pytest.mark.parametrize("name", PEERS)
def test_a_script_imports_nothing_of_this_package_when_it_runs(name):
    """Its environment has no other packages than those of the peer."""
    tree = ast.parse(PEERS[name].script.read_text(encoding="utf-8"))
    imported = {
        each.split(".")[0]
        for node in tree.body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for each in (
            [node.module] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
        )
    }
    module = PEERS[name].package.replace("-", "_")
    assert module in imported
    assert imported <= {module, "numpy", "jax", "typing", "math"}


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_is_pinned_and_described(name):
    peer = PEERS[name]
    assert all(part.isdigit() for part in peer.version.split("."))
    assert peer.setting.endswith(".")


def test_a_peer_is_no_dependency_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    groups = [
        project["project"]["dependencies"],
        *project["project"]["optional-dependencies"].values(),
        *project["dependency-groups"].values(),
    ]
    named = str(groups)
    assert not [peer.package for peer in PEERS.values() if peer.package in named]
