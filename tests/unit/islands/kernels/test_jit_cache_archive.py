"""The archive of the package has the code of its kernels; nothing else is loaded from it."""

import json
import os
import platform
import subprocess
import sys
from zipfile import ZipFile

import pytest

from islands.kernels import jit_cache
from islands.kernels.jit_cache import ARCHIVE, MANIFEST, Manifest, digest_source, is_current, read_manifest
from support.repository import ROOT

#: Script that uses the kernels of all commands, and prints the files that it has stored.
USE = """
from islands.facade.warm_up import use_other_kernels, warm_up
from islands.kernels.jit_cache import cache_folder
from islands_service.intake.simulation_server import compile_kernels
from support.block_cases import OF_BLOCKS, start_from_record
from support.kernels import compile_further_kernels

assert not warm_up(print)
use_other_kernels()
compile_further_kernels()
compile_kernels()
for name in OF_BLOCKS:
    start_from_record(name)
print(*sorted(path.name for path in cache_folder().rglob("*.nbc")))
"""

needs_archive = pytest.mark.skipif(
    (platform.machine(), sys.implementation.cache_tag) != ("x86_64", "cpython-311"),
    reason="the archive is for x86-64 and Python 3.11",
)


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    with ZipFile(ARCHIVE) as archive:
        return Manifest(**json.loads(archive.read(MANIFEST)))


def test_archive_was_compiled_from_the_present_sources(manifest: Manifest) -> None:
    changed = [path for path, digest in manifest.digests.items() if digest_source(path) != digest]
    assert not changed, "run make kernels"
    assert manifest.imports.keys() >= {"kernels/population.py", "program/primitive_functions.py"}


def test_archive_contains_no_path_of_the_machine_that_made_it() -> None:
    with ZipFile(ARCHIVE) as archive:
        for name in archive.namelist():
            content = archive.read(name)
            assert b"site-packages" not in content, name
            assert str(ROOT).encode() not in content, name


@needs_archive
@pytest.mark.parametrize("changed", ["kernels/gram.py", "kernels/callee.py"])
def test_code_is_used_as_long_as_its_module_and_the_imported_ones_are_unchanged(
    manifest: Manifest, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    monkeypatch.setattr(
        jit_cache, "digest_source", lambda path: "" if path == changed else digest_source(path)
    )
    used = {module for module in manifest.imports if is_current.__wrapped__(module)}
    assert used == {module for module, sources in manifest.imports.items() if changed not in sources}
    assert ("kernels/summation.py" in used) == (changed == "kernels/gram.py")
    assert "kernels/population.py" not in used


@needs_archive
def test_other_processors_and_versions_use_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert read_manifest.__wrapped__() is not None
    changes = {
        "get_features": lambda: dict.fromkeys(jit_cache.FEATURES, True) | {"avx2": False},
        "describe_target": lambda: ["x86-64-v3", "x86_64-unknown-linux-gnu", "cpython-312", "0.68.1"],
        "ARCHIVE": ROOT / "absent.zip",
    }
    for name, other in changes.items():
        with monkeypatch.context() as patch:
            patch.setattr(jit_cache, name, other)
            jit_cache._open_archive.cache_clear()
            assert read_manifest.__wrapped__() is None, name
    for name, features, is_used in (("x86-64-v3", "", True), ("x86-64-v4", "", False), (None, "+avx", False)):
        monkeypatch.setattr(jit_cache.config, "CPU_NAME", name)
        monkeypatch.setattr(jit_cache.config, "CPU_FEATURES", features)
        jit_cache._open_archive.cache_clear()
        assert (read_manifest.__wrapped__() is not None) == is_used


@needs_archive
@pytest.mark.ci
def test_no_command_and_no_simulation_compiles_a_kernel(tmp_path) -> None:
    environment = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"ISLANDS_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT / "tests")}
    done = subprocess.run(
        [sys.executable, "-c", USE], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.split()) == (0, []), done.stderr
