"""Report of a result in a browser: one file, first screen, printed pages, both colour schemes."""

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import islands
from islands.report.figures.names import ALL_FIGURES
from islands.report.figures.style import FRAME, MEASURED, RESIDUAL, SIMULATED
from islands.report.pages.saved_result import report_saved_result
from support.contrast import LINE_CONTRAST, contrast, shown_in_dark
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


@pytest.mark.parametrize("width", [1440, 390])
def test_the_report_fits_its_window(quiet: Callable[..., Screen], report: Path, width: int) -> None:
    page = open_report(quiet, report, width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_print_is_white_in_a_dark_colour_scheme(quiet: Callable[..., Screen], report: Path) -> None:
    page = open_report(quiet, report, color_scheme="dark")
    styles = "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.images[0]).filter]"
    assert page.evaluate(styles) == ["rgb(16, 22, 26)", "invert(1) hue-rotate(180deg)"]
    page.emulate_media(media="print")
    assert page.evaluate(styles) == ["rgb(255, 255, 255)", "none"]


@pytest.mark.parametrize("colour", [MEASURED, SIMULATED, RESIDUAL, FRAME])
def test_lines_are_legible_in_the_dark(quiet: Callable[..., Screen], report: Path, colour: str) -> None:
    page = open_report(quiet, report, color_scheme="dark")
    swatch = (
        "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='80' height='40'>"
        "<rect width='80' height='40' fill='white'/>"
        f"<rect width='40' height='40' fill='{colour}'/></svg>"
    )
    page.evaluate(
        "async (source) => { const image = document.images[0]; image.src = source; await image.decode(); }",
        swatch.replace("#", "%23"),
    )
    picture = Image.open(io.BytesIO(page.locator("img").first.screenshot())).convert("RGB")
    line, paper = (picture.getpixel((int(picture.width * at), picture.height // 2)) for at in (0.25, 0.75))
    assert paper == (16, 22, 26)
    assert contrast(line, paper) >= LINE_CONTRAST
    # The unit tests of all figures compute the same colours.
    expected = shown_in_dark([int(colour[at : at + 2], 16) for at in (1, 3, 5)], paper)
    assert line == pytest.approx(expected, abs=2)
