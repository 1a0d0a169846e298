"""No file of the repository installs the project by its name, which is in no index of packages."""

import re
import tomllib
from collections.abc import Iterator

import pytest

import islands
from islands.distribution import NAME
from support.repository import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

EXTRAS = PROJECT["optional-dependencies"].keys()

#: Names of the import package and of the distribution, as a user may write them.
NAMES = r"islands(?:[-_.]sysid)?"

#: Beginning of a command that installs requirements.
INSTALL = r"\b(?:pip[x3]?|uv|uvx|pdm|poetry|conda|mamba)\s[^\n]*?\b(?:install|add|run)\b[^\n]*?[\s'\"]"

#: Installation of a requirement that begins with one of our names and is no file; and such a requirement with
#: extras in any place.
BY_NAME = re.compile(
    rf"{INSTALL}({NAMES}(?:\[[\w, -]+\])?)(?=['\"`\s;,.=<>~]|$)"
    rf"|(?<![/\w-])({NAMES}\[(?:{'|'.join(EXTRAS)})\b[\w, -]*\])",
    re.MULTILINE,
)

#: Files with our names that install nothing.
EXEMPT = {"requirements.lock", "test_installed_names.py"}

#: Folders with everything that a user or a developer reads or runs.
FOLDERS = (
    ".ci",
    "api",
    "deploy",
    "docs",
    "examples",
    "lab",
    "services",
    "src",
    "tests",
)


def files() -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each file of the repository but this one."""
    paths = [path for path in ROOT.iterdir() if path.is_file()]
    paths += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    for path in paths:
        if "__pycache__" not in path.parts and path.suffix != ".svg" and path.name not in EXEMPT:
            try:
                yield str(path.relative_to(ROOT)), path.read_text("utf-8")
            except UnicodeDecodeError:
                continue


@pytest.mark.ci
def test_no_file_installs_the_project_by_name():
    found = {(path, "".join(match.groups(""))) for path, text in files() for match in BY_NAME.finditer(text)}
    # Extras that consist of other extras.
    composed = {("pyproject.toml", PROJECT["optional-dependencies"][extra][0]) for extra in ("all", "server")}
    assert found == composed


def test_the_distribution_has_the_name_and_the_version_of_the_project():
    assert (NAME, islands.__version__) == (PROJECT["name"], PROJECT["version"])
