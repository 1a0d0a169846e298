"""Style of figures: labels, matplotlib settings, reproducible files."""

import hashlib
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.report.figures.free_run import draw_free_run
from islands.report.figures.style import label, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def example() -> "Figure":
    u = np.sin(np.arange(300) / 10)
    return draw_free_run(
        Dataset(u, 2 * u, 0.1, ("u_V",), "y_um", ("V",), "um"), 1.9 * u, "the same $ content_"
    )


@pytest.fixture
def matplotlib() -> ModuleType:
    return import_module("matplotlib")


@pytest.mark.parametrize(
    ("name", "unit", "expected"),
    [
        ("y_um", "um", "y (um)"),
        ("u_est_V", "V", "u_est (V)"),
        ("force [N]", "N", "force (N)"),
        ("force (N)", "N", "force (N)"),
        ("y", "um", "y (um)"),
        ("y_um", "m", "y_um (m)"),
        ("y_um", "", "y_um"),
        ("_V", "V", "(V)"),
    ],
)
def test_label_is_the_name_with_the_unit_in_parentheses(name, unit, expected):
    assert label(name, unit) == expected


def test_file_has_no_date_no_image_and_no_font(tmp_path, matplotlib):
    save(example(), str(tmp_path / "figure.svg"))
    text = (tmp_path / "figure.svg").read_text(encoding="utf-8")
    assert text.count("<svg ") == 1
    for unwanted in ("dc:date", "<image", "<text", "font-family", matplotlib.__version__):
        assert unwanted not in text


@pytest.mark.ci
def test_another_process_writes_equal_bytes_without_pyplot(tmp_path):
    code = """
import hashlib, importlib.util, pkgutil, sys
import islands.report.figures
for module in pkgutil.iter_modules(islands.report.figures.__path__):
    importlib.import_module("islands.report.figures." + module.name)
assert "islands.report.figures.hysteresis" in sys.modules
spec = importlib.util.spec_from_file_location("tests_of_style", sys.argv[1])
tests = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tests)
tests.save(tests.example(), sys.argv[2])
print("matplotlib.pyplot" in sys.modules)
"""
    expected, actual = tmp_path / "expected.svg", tmp_path / "actual.svg"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, __file__, str(expected)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout == "False\n"
    save(example(), actual)
    assert digest(expected) == digest(actual)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
