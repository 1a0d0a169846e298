"""Report of a result in a browser: one file, first screen, printed pages, both colour schemes."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import islands
from islands.report.figures.names import ALL_FIGURES
from islands.report.pages.identification import report_saved_result
from support.identifications import record
from support.screen import Screen

pytestmark = pytest.mark.ci

#: Largest number of A4 pages of the report of a search of nine models of hysteresis with all figures.
MAX_PAGES = 4

SETTINGS = {"library": "phi-polynomial", "degree": 3, "lags": 3, "max_terms": 9, "certificate": 0}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a model of hysteresis."""
    found = islands.fit(record(1500), average=1, constraints="hysteresis", **SETTINGS)
    assert len(found.models) > 5
    folder = found.save(tmp_path_factory.mktemp("report") / "hysteresis", figures=ALL_FIGURES)
    path = folder / "report.html"
    path.write_bytes(report_saved_result(folder))
    return path


def open_report(quiet: Callable[..., Screen], report: Path, **options: Any) -> Any:
    """Open a report; requests of other files are foreign."""
    return quiet(report.parent.as_uri(), **options).go(report.name)


def test_the_error_and_the_free_run_are_the_first_screen(quiet: Callable[..., Screen], report: Path) -> None:
    page = open_report(quiet, report, width=1440, height=900)
    assert re.search(
        r"simulates y with a mean absolute error of \S+\s% of its range\.", page.inner_text("h1")
    )
    box = page.locator("img").first.bounding_box()
    assert box["y"] + box["height"] <= 900
    assert box["y"] < page.locator("math").bounding_box()["y"]


def test_the_report_prints_on_four_pages(quiet: Callable[..., Screen], report: Path) -> None:
    page = open_report(quiet, report)
    printed = page.pdf(format="A4", print_background=True)
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= MAX_PAGES
