"""The shape of the tests: unit tests mirror the sources, files are short, collection loads nothing heavy."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from support.repository import ROOT

TESTS = ROOT / "tests"
UNIT = TESTS / "unit"

#: Where the sources are that a folder of the unit tests mirrors.
SOURCES = {
    "islands": ROOT / "src" / "islands",
    "islands_service": ROOT / "services" / "islands_service",
    "islands_api": ROOT / "api" / "islands_api",
}

#: Lines of a file of tests.
LONGEST = 400

#: What takes half a second or more to load.
HEAVY = {"matplotlib", "numba", "ray"}


def files_of_tests(folder: Path) -> list[Path]:
    return sorted(folder.rglob("test_*.py"))


def mirrored(folder: Path) -> Path:
    """Return the place in the sources of a folder of unit tests."""
    package, *inner = folder.relative_to(UNIT).parts
    return SOURCES[package].joinpath(*inner)


def parts(package: Path) -> set[str]:
    """Return the names of the modules and of the packages of a package."""
    modules = {path.stem for path in package.glob("*.py")}
    return {
        name.strip("_") for name in modules | {path.parent.name for path in package.glob("*/__init__.py")}
    }


def at_collection(nodes: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements that run when a module is loaded, but those for a checker of types."""
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
    """Return the names of the packages that a module imports when it is loaded."""
    found = set()
    for node in at_collection(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(node, ast.Import):
            found |= {each.name.partition(".")[0] for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.partition(".")[0])
    return found


def test_every_folder_of_unit_tests_mirrors_a_package_or_a_module() -> None:
    """A module whose tests fill several files has a folder of its own."""
    folders = {path.parent for path in files_of_tests(UNIT)}
    lost = [
        str(folder.relative_to(UNIT))
        for folder in sorted(folders)
        if not (mirrored(folder) / "__init__.py").exists()
        and not mirrored(folder).with_suffix(".py").exists()
    ]
    assert not lost


def test_every_unit_test_file_is_named_after_a_module() -> None:
    """A subject may stand behind the name of the module or package: ``test_matlab_damage``."""
    nameless = []
    for path in files_of_tests(UNIT):
        place, name = mirrored(path.parent), path.stem.removeprefix("test_")
        if place.is_dir() and not any(name == part or name.startswith(f"{part}_") for part in parts(place)):
            nameless.append(str(path.relative_to(UNIT)))
    assert not nameless


def test_test_files_are_below_the_length_limit() -> None:
    long = {
        str(path.relative_to(TESTS)): count
        for path in files_of_tests(TESTS)
        if (count := len(path.read_text(encoding="utf-8").splitlines())) > LONGEST
    }
    assert not long


@pytest.mark.parametrize("name", sorted(HEAVY))
def test_test_modules_do_not_import_heavy_packages_at_collection(name: str) -> None:
    assert not [
        str(path.relative_to(TESTS)) for path in sorted(TESTS.rglob("*.py")) if name in imported(path)
    ]
