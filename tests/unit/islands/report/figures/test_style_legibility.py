"""Properties of all figures: texts are neither cut off nor overlapping, and saving is reproducible."""

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import islands
from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model
from islands.records.dataset import Dataset
from islands.report.figures.diagnosis import DIAGNOSIS_FIGURES
from islands.report.figures.free_run import draw_free_run
from islands.report.figures.hysteresis import draw_holds, draw_loop
from islands.report.figures.latent import draw_structure, draw_unit_curves
from islands.report.figures.linear_system import draw_bode
from islands.report.figures.residuals import draw_residual_correlations
from islands.report.figures.style import save
from islands.validation.residual_tests import residual_tests
from support.contrast import DARK_PAPER, LINE_CONTRAST, contrast, shown_in_dark
from support.latent_systems import make_large_model

pytestmark = pytest.mark.ci

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox


LONG_TITLE = (
    "Title of a figure in a report with the name of a record and the name of a model, both rather long"
)


def record(samples: int, inputs: int = 1, scale: float = 1.0, dt: float = 1e-3, **changes: object) -> Dataset:
    rng = np.random.default_rng(7)
    time = np.arange(samples)
    u = np.column_stack([np.sin(time / (15 + channel)) for channel in range(inputs)])
    y = scale * (np.sin(time / 15 - 0.3) + 0.05 * rng.standard_normal(samples))
    names, units = tuple(f"u{channel}_V" for channel in range(inputs)), ("V",) * inputs
    return Dataset(scale * u, y, dt, names, "y_um", units, "um", **changes)


def leaking(pole: float) -> Model:
    return make_model([(parse("y(k-1)"), pole), (parse("u(k-1)"), 0.02)], ("u0_V",), "y_um", 1e-3)


@cache
def diagnosis(samples: int, scale: float, dt: float):
    """Return a diagnosis of a recorded simulation without an offset."""
    made = record(samples, scale=scale, dt=dt)
    noise = np.random.default_rng(8).standard_normal(samples)
    simulated = made.y - scale * (0.3 + 0.05 * noise)
    return islands.diagnose(made, "column:y_sim", columns={"y_sim": simulated})


SHORT, LONG = record(200), record(20_000)
TWO = record(600, inputs=2, segments=(350, 250))
LARGE = record(5_000, scale=12_345.0, start=1e4)
LATENT = make_large_model()
NAMED = {"input_names": LATENT.column_names, "output_name": LATENT.output_name}
NAMED |= {"input_units": ("V", "degC", "V"), "output_unit": "degC"}
WARM, WARMER = (replace(record(300, 3, scale, 0.01), **NAMED) for scale in (1.0, 1.3))
FIGURES: dict[str, "Callable[[], Figure]"] = {
    "a short run": lambda: draw_free_run(SHORT, 0.97 * SHORT.y),
    "a long run": lambda: draw_free_run(LONG, 0.97 * LONG.y, LONG_TITLE),
    "a run of two segments": lambda: draw_free_run(TWO, 0.97 * TWO.y, "two segments"),
    "a run of large numbers": lambda: draw_free_run(LARGE, 0.97 * LARGE.y, "large"),
    "a diverged run": lambda: draw_free_run(SHORT, np.where(np.arange(200) < 90, SHORT.y, np.nan)),
    "a run of nothing": lambda: draw_free_run(SHORT, np.full(200, np.nan), "nothing"),
    "a loop": lambda: draw_loop(LONG, 0.97 * LONG.y, LONG_TITLE),
    "a loop of two inputs": lambda: draw_loop(TWO, 0.97 * TWO.y),
    "a loop of four inputs": lambda: draw_loop(record(300, 4), np.full(300, np.nan), LONG_TITLE),
    "a drifting hold": lambda: draw_holds(leaking(0.9), LONG, LONG_TITLE),
    "a diverging hold": lambda: draw_holds(leaking(1.01), LARGE),
    "a structure": lambda: draw_structure(LATENT),
    "curves of six units": lambda: draw_unit_curves(LATENT, WARM, LATENT.memory, further=WARMER),
    "a frequency response": lambda: draw_bode(LATENT.linearise()),
    "residuals": lambda: draw_residual_correlations(residual_tests(SHORT.y, SHORT.u), LONG_TITLE),
    "residuals of two inputs": lambda: draw_residual_correlations(residual_tests(TWO.y, TWO.u)),
    "residuals of a constant": lambda: draw_residual_correlations(residual_tests(SHORT.y, 0 * SHORT.u)),
    **{
        f"{name} of a diagnosis, {of[0]} samples of {of[2]:g} s": lambda draw=draw, of=of: draw(
            diagnosis(*of)
        )
        for name, draw in DIAGNOSIS_FIGURES.items()
        # The spectrum of the third case has little more than one decade.
        for of in ((400, 1.0, 1e-3), (800, 12_345.0, 1e-3), (400, 1.0, 7.0))
    },
}


#: All figures of the diagnosis of one record. The level ci checks one of them.
DIAGNOSED = tuple(f"{name} of a diagnosis, 400 samples of 0.001 s" for name in DIAGNOSIS_FIGURES)

#: Figures that are saved twice at the level ci.
SAVED = ("a run of two segments", "a loop of two inputs", DIAGNOSED[1])


def fast(names: Iterable[str]) -> pytest.MarkDecorator:
    """Parametrise a test by all figures; those not in ``names`` belong to the nightly level."""
    kept = set(names)
    return pytest.mark.parametrize(
        "name", [name if name in kept else pytest.param(name, marks=pytest.mark.nightly) for name in FIGURES]
    )


#: Figures whose layout is checked at the level ci: one of each kind, with the longest texts.
LAID_OUT = (
    *("a long run", "a run of two segments", "a loop of four inputs", "a diverging hold"),
    *("residuals of two inputs", DIAGNOSED[1]),
    *("a structure", "curves of six units", "a frequency response"),
)

every_figure = fast(LAID_OUT)


@dataclass(frozen=True)
class Drawn:
    """Figure with the boxes of all texts that are drawn; ticks outside the axes are not drawn."""

    figure: "Figure"
    texts: "list[tuple[Text, Bbox]]"


@cache
def drawn(name: str) -> Drawn:
    from matplotlib.text import Text

    texts: dict[int, Text] = {}
    figure, original = FIGURES[name](), Text.draw

    def draw(self, renderer):
        if self.get_visible() and self.get_text().strip():
            texts[id(self)] = self
        return original(self, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        figure.draw_without_rendering()
    return Drawn(figure, [(text, text.get_window_extent()) for text in texts.values()])


@every_figure
def test_text_is_not_cut_off_at_the_edge(name):
    edge, texts = drawn(name).figure.bbox, drawn(name).texts
    assert len(texts) > 10
    for text, box in texts:
        assert edge.x0 <= box.x0, text.get_text()
        assert edge.y0 <= box.y0, text.get_text()
        assert box.x1 <= edge.x1, text.get_text()
        assert box.y1 <= edge.y1, text.get_text()


@every_figure
def test_texts_do_not_overlap(name):
    inner = [(text.get_text(), box.padded(-1)) for text, box in drawn(name).texts]
    over = [
        (one, other)
        for (one, box), (other, other_box) in itertools.combinations(inner, 2)
        if box.overlaps(other_box)
    ]
    assert over == []


@fast(SAVED)
def test_saving_twice_gives_equal_bytes(name, tmp_path):
    for file in ("first", "second"):
        save(drawn(name).figure, tmp_path / f"{file}.svg")
    assert (tmp_path / "first.svg").read_bytes() == (tmp_path / "second.svg").read_bytes()


@every_figure
def test_lines_have_a_contrast_of_three_in_both_colour_schemes(name):
    from matplotlib.colors import to_rgb
    from matplotlib.patches import FancyArrowPatch, PathPatch

    lines = [line.get_color() for axes in drawn(name).figure.axes for line in axes.lines]
    # A diagram has its lines as patches.
    patches = [each for axes in drawn(name).figure.axes for each in axes.patches]
    lines += [each.get_edgecolor() for each in patches if isinstance(each, FancyArrowPatch | PathPatch)]
    colours = {tuple(255 * each for each in to_rgb(line)) for line in lines}
    assert colours
    for colour in colours:
        assert contrast(colour, (255, 255, 255)) >= LINE_CONTRAST, colour
        assert contrast(shown_in_dark(colour), DARK_PAPER) >= LINE_CONTRAST, colour
