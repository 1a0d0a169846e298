"""Structure of the repository: imports, packages and names."""

import re
import subprocess
import sys
import sysconfig
from collections import Counter, defaultdict
from itertools import pairwise
from pathlib import Path

import pytest

from support.repository import ROOT

FOLDERS = ("src", "services", "api")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))

#: Class names that two modules use: the client and the OpenAPI document name them like the core does.
SHARED_CLASS_NAMES = {"Event", "HistoryPoint", "Preview"}


#: Modules in a folder and its folders, at least. A smaller one hides its modules behind one more name.
LEAST_MODULES = 3


def test_imports_keep_the_contracts() -> None:
    """The contracts are in ``pyproject.toml``."""
    command = Path(sysconfig.get_path("scripts")) / "lint-imports"
    done = subprocess.run([command, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_source_folder_is_a_package_with_a_docstring() -> None:
    folders = {path.parent for path in SOURCES}
    for folder in folders:
        assert (folder / "__init__.py").read_text().startswith('"""'), folder


def test_every_module_has_a_docstring() -> None:
    for path in SOURCES:
        assert path.read_text().lstrip("r").startswith('"""'), path


def test_a_class_name_is_unique() -> None:
    """Searching for a class name must find one class only."""
    places: dict[str, set[Path]] = defaultdict(set)
    for path in SOURCES:
        for name in re.findall(r"^class ([A-Za-z]\w*)", path.read_text(), re.MULTILINE):
            places[name].add(path)
    assert {name for name, found in places.items() if len(found) > 1} == SHARED_CLASS_NAMES


def test_a_folder_has_several_modules() -> None:
    modules = [path for path in SOURCES if "__" not in path.stem]
    found = Counter(folder for path in modules for folder in path.parents)
    small = {folder for folder in {path.parent for path in SOURCES} if found[folder] < LEAST_MODULES}
    # Alembic loads every module of this folder as a revision, and there is one for each change of the schema.
    assert small <= {ROOT / "services/islands_service/store/migrations/versions"}


def test_no_name_repeats_that_of_its_folder() -> None:
    """``records/reader.py`` and not ``records/record_reader.py``; names of plurals count as well."""
    repeating = [
        str(path.relative_to(ROOT))
        for path in SOURCES
        for folder, name in pairwise(path.relative_to(ROOT).with_suffix("").parts[1:])
        if repeats(name, folder)
    ]
    assert not repeating


def repeats(name: str, folder: str) -> bool:
    """Return whether a name begins or ends with that of its folder, in the singular or the plural."""
    words, parent = ([word.removesuffix("s") for word in each.split("_")] for each in (name, folder))
    return parent in (words[: len(parent)], words[-len(parent) :])


def test_no_module_has_a_catch_all_name() -> None:
    for path in SOURCES:
        assert not {"utils", "helpers", "common", "misc"} & {path.stem, *path.parts}, path


@pytest.mark.parametrize("package", ["api.islands_api", "services.islands_service"])
def test_a_source_folder_is_not_importable_as_a_package(package: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import {package}"], cwd=ROOT / "src", capture_output=True, check=False
    )
    assert done.returncode != 0


def test_the_lock_file_names_hashes_and_no_index() -> None:
    text = (ROOT / "requirements.lock").read_text()
    assert "--hash=sha256:" in text
    assert "://" not in text
    assert "--index-url" not in text
