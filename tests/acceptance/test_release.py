"""A release has one version, and the recipe for conda requires what pyproject.toml requires."""

import re
import tomllib
from typing import Any

import pytest
import yaml

from support.repository import ROOT

SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = SETTINGS["project"]

#: Packages that conda-forge calls otherwise: here without the graphical toolkits.
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


@pytest.fixture(scope="module")
def recipe() -> dict[str, Any]:
    text = (ROOT / "deploy/conda/recipe.yaml").read_text("utf-8")
    return yaml.safe_load(text.replace("${{ version }}", PROJECT["version"]))


def split(requirement: str) -> tuple[str, str]:
    """Return the name and the versions of a requirement."""
    name = re.split(r"[ <>=]", requirement)[0]
    return name, requirement.removeprefix(name).strip()


def test_all_files_state_one_version(recipe: dict[str, Any]) -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))["version"]
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert newest
    stated = {citation, newest[1], recipe["context"]["version"], recipe["package"]["version"]}
    assert stated == {PROJECT["version"]}


def test_the_recipe_describes_the_project(recipe: dict[str, Any]) -> None:
    assert recipe["package"]["name"] == PROJECT["name"]
    about = recipe["about"]
    assert (about["summary"], about["license"]) == (PROJECT["description"], PROJECT["license"])
    assert PROJECT["license-files"] == [about["license_file"]]
    programs = [f"{name} = {function}" for name, function in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == programs
    archive = f"dist/{PROJECT['name'].replace('-', '_')}-{PROJECT['version']}.tar.gz"
    assert recipe["source"]["path"] == f"../../{archive}"


def test_the_recipe_requires_what_the_core_requires(recipe: dict[str, Any]) -> None:
    python = ("python", PROJECT["requires-python"])
    core = [split(line) for line in PROJECT["dependencies"]]
    expected = [python, *((CONDA_NAMES.get(name, name), versions) for name, versions in core)]
    assert [split(line) for line in recipe["requirements"]["run"]] == expected
    backend = map(split, SETTINGS["build-system"]["requires"])
    assert [split(line) for line in recipe["requirements"]["host"]] == [python, ("pip", ""), *backend]
