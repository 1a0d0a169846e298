"""Structure of the tests: unit tests mirror the sources, imports are light."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from support.repository import ROOT

TESTS = ROOT / "tests"
UNIT = TESTS / "unit"

#: Source folders that the folders of the unit tests mirror.
SOURCES = {
    "islands": ROOT / "src" / "islands",
    "islands_service": ROOT / "services" / "islands_service",
    "islands_api": ROOT / "api" / "islands_api",
}

#: Packages that take half a second or more to import.
HEAVY = {"matplotlib", "numba", "ray"}


def files_of_tests(folder: Path) -> list[Path]:
    return sorted(folder.rglob("test_*.py"))


def mirrored(folder: Path) -> Path:
    """Return the source path that a folder of unit tests mirrors."""
    package, *inner = folder.relative_to(UNIT).parts
    return SOURCES[package].joinpath(*inner)


def parts(package: Path) -> set[str]:
    """Return the names of the modules and subpackages of a package."""
    modules = {path.stem for path in package.glob("*.py")}
    return {
        name.strip("_") for name in modules | {path.parent.name for path in package.glob("*/__init__.py")}
    }


def at_collection(nodes: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements that run when a module is imported, without those for type checkers."""
    for node in nodes:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        if isinstance(node, ast.If | ast.With | ast.Try | ast.ClassDef):
            yield from at_collection(
                [each for each in ast.iter_child_nodes(node) if isinstance(each, ast.stmt)]
            )


@cache
def imported(path: Path) -> set[str]:
    """Return the names of the packages that a module imports at import time."""
    found = set()
    for node in at_collection(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(node, ast.Import):
            found |= {each.name.partition(".")[0] for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.partition(".")[0])
    return found


def test_every_folder_of_unit_tests_mirrors_a_package_or_a_module() -> None:
    """Tests of a module that need several files are in a folder with the name of the module."""
    folders = {path.parent for path in files_of_tests(UNIT)}
    unmatched = [
        str(folder.relative_to(UNIT))
        for folder in sorted(folders)
        if not (mirrored(folder) / "__init__.py").exists()
        and not mirrored(folder).with_suffix(".py").exists()
    ]
    assert not unmatched


def test_every_unit_test_file_is_named_after_a_module() -> None:
    """A subject may follow the name of the module or package: ``test_matlab_damage``."""
    unmatched = []
    for path in files_of_tests(UNIT):
        place, name = mirrored(path.parent), path.stem.removeprefix("test_")
        if place.is_dir() and not any(name == part or name.startswith(f"{part}_") for part in parts(place)):
            unmatched.append(str(path.relative_to(UNIT)))
    assert not unmatched


@pytest.mark.parametrize("name", sorted(HEAVY))
def test_test_modules_do_not_import_heavy_packages_at_collection(name: str) -> None:
    assert not [
        str(path.relative_to(TESTS))
        for path in sorted(TESTS.rglob("*.py"))
        if name in path.read_text("utf-8") and name in imported(path)
    ]
