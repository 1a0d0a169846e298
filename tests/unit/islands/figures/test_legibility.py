"""What holds for every figure: no text is cut off or written over another, and saving is repeatable."""

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import islands
from islands.data.dataset import Dataset
from islands.figures.discrepancy import DISCREPANCY_FIGURES
from islands.figures.free_run import draw_free_run
from islands.figures.hold import draw_holds
from islands.figures.loop import draw_loop
from islands.figures.residuals import draw_residual_correlations
from islands.figures.style import save
from islands.model.model import Model, model_of
from islands.model.parsing import parse
from islands.validation.residual_tests import residual_tests

LONG_TITLE = "What a report may want to say over a figure, with the name of a record and of a model, is long"


def record(samples: int, inputs: int = 1, scale: float = 1.0, dt: float = 1e-3, **changes: object) -> Dataset:
    rng = np.random.default_rng(7)
    time = np.arange(samples)
    u = np.column_stack([np.sin(time / (15 + channel)) for channel in range(inputs)])
    y = scale * (np.sin(time / 15 - 0.3) + 0.05 * rng.standard_normal(samples))
    names, units = tuple(f"u{channel}_V" for channel in range(inputs)), ("V",) * inputs
    return Dataset(scale * u, y, dt, names, "y_um", units, "um", **changes)


def leaking(pole: float) -> Model:
    return model_of([(parse("y(k-1)"), pole), (parse("u(k-1)"), 0.02)], ("u0_V",), "y_um", 1e-3)


@cache
def diagnosis(samples: int, scale: float, dt: float):
    """Return a diagnosis of a column that lacks an offset."""
    made = record(samples, scale=scale, dt=dt)
    noise = np.random.default_rng(8).standard_normal(samples)
    simulated = made.y - scale * (0.3 + 0.05 * noise)
    return islands.diagnose(made, "column:y_sim", columns={"y_sim": simulated})


SHORT, LONG = record(200), record(20_000)
TWO = record(600, inputs=2, segments=(350, 250))
LARGE = record(5_000, scale=12_345.0, start=1e4)
FIGURES: dict[str, Callable[[], Figure]] = {
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
    "residuals": lambda: draw_residual_correlations(residual_tests(SHORT.y, SHORT.u), LONG_TITLE),
    "residuals of two inputs": lambda: draw_residual_correlations(residual_tests(TWO.y, TWO.u)),
    "residuals of a constant": lambda: draw_residual_correlations(residual_tests(SHORT.y, 0 * SHORT.u)),
    **{
        f"{name} of a diagnosis, {of[0]} samples of {of[2]:g} s": lambda draw=draw, of=of: draw(
            diagnosis(*of)
        )
        for name, draw in DISCREPANCY_FIGURES.items()
        # The third one's spectrum has little more than a decade.
        for of in ((400, 1.0, 1e-3), (2000, 12_345.0, 1e-3), (400, 1.0, 7.0))
    },
}


@pytest.fixture(params=FIGURES, scope="module")
def figure(request: pytest.FixtureRequest) -> Figure:
    return FIGURES[request.param]()


@pytest.fixture(scope="module")
def texts(figure: Figure) -> list[Text]:
    """Every text that is drawn: no tick outside its axis is among them."""
    drawn: dict[int, Text] = {}
    original = Text.draw

    def draw(self, renderer):
        if self.get_visible() and self.get_text().strip():
            drawn[id(self)] = self
        return original(self, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        figure.draw_without_rendering()
    return list(drawn.values())


def test_no_text_is_cut_off_at_the_edge(figure, texts):
    assert len(texts) > 10
    for text in texts:
        box = text.get_window_extent()
        assert figure.bbox.x0 <= box.x0, text.get_text()
        assert figure.bbox.y0 <= box.y0, text.get_text()
        assert box.x1 <= figure.bbox.x1, text.get_text()
        assert box.y1 <= figure.bbox.y1, text.get_text()


def test_no_text_is_written_over_another(texts):
    for one, other in itertools.combinations(texts, 2):
        assert not one.get_window_extent().padded(-1).overlaps(other.get_window_extent().padded(-1)), (
            one.get_text(),
            other.get_text(),
        )


def test_no_text_is_smaller_than_a_journal_prints(texts):
    assert min(text.get_fontsize() for text in texts) >= 7.0


def test_saving_twice_gives_the_same_bytes(figure, tmp_path):
    for name in ("first", "second"):
        save(figure, tmp_path / f"{name}.svg")
    assert (tmp_path / "first.svg").read_bytes() == (tmp_path / "second.svg").read_bytes()
