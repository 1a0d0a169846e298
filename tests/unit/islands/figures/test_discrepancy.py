"""The figures of a diagnosis: what is in each, and what none may show."""

from functools import cache

import numpy as np
import pytest

import islands
from islands.figures.discrepancy import DISCREPANCY_FIGURES, draw_residual, draw_screening
from islands.figures.style import save

pytestmark = pytest.mark.usefixtures("without_layout")

DT = 0.01


@cache
def diagnosis(friction: float = 0.3, levels: int = 0, samples: int = 900):
    """Return a diagnosis of a column that lacks dry friction; its input may be a staircase."""
    rng = np.random.default_rng(5)
    time = DT * np.arange(samples)
    u = 4 * np.sin(3 * time) * np.sin(0.8 * time + 0.5)
    if levels:
        u = np.round(u * levels / 4) * 4 / levels
    simulated = 1.5 * u
    y = simulated - friction * np.sign(np.gradient(u)) + 0.05 * rng.standard_normal(samples)
    record = islands.Dataset(
        u[:, None], y, DT, input_names=("u_V",), input_units=("V",), output_name="y_um", output_unit="um"
    )
    return islands.diagnose(record, "column:y_sim", columns={"y_sim": simulated})


@cache
def of_the_residual():
    """Return the figure of the residual before and after."""
    return draw_residual(diagnosis())


@cache
def long():
    """Return the figures of a diagnosis of a long record, by name."""
    found = diagnosis(samples=6000)
    return {name: draw(found) for name, draw in DISCREPANCY_FIGURES.items()}


def test_the_residual_is_shown_against_all_that_it_should_not_know() -> None:
    axes = of_the_residual().axes
    assert [panel.get_xlabel() for panel in axes] == [
        "u (V)",
        "u (V)",
        "rate of the input (V/s)",
        "simulated output (um)",
        "frequency (Hz)",
        "lag (samples)",
    ]
    # Before and after, and nothing that is not a number.
    for panel in axes:
        coloured = {line.get_color() for line in panel.lines}
        assert {"#e69f00", "#0072b2"} <= coloured
        assert all(np.isfinite(line.get_xydata()).all() for line in panel.lines)


def test_dry_friction_is_a_difference_between_the_directions_before_and_none_after() -> None:
    lines = of_the_residual().axes[1].lines[:-1]
    mean = {
        (line.get_color(), line.get_linestyle()): np.mean(line.get_ydata())
        for line in lines
        if len(line.get_ydata()) > 2
    }
    before = mean["#e69f00", "-"] - mean["#e69f00", "--"]
    after = mean["#0072b2", "-"] - mean["#0072b2", "--"]
    assert before == pytest.approx(-0.6, abs=0.05)
    assert after == pytest.approx(0.0, abs=0.05)


def test_the_spectrum_holds_the_residuals_mean_square() -> None:
    found = diagnosis()
    before = of_the_residual().axes[4].lines[0]
    frequency, density = before.get_xydata().T
    residual = found.record.y - found.base.output
    assert np.trapezoid(density**2, frequency) == pytest.approx(np.var(residual), rel=0.25)


def test_an_input_of_few_levels_has_as_many_cells_and_no_empty_one() -> None:
    """An empty cell has no mean: drawn as zero it would look like a residual that vanishes."""
    found = diagnosis(levels=2)
    over_input = draw_residual(found).axes[0].lines[0]
    assert set(over_input.get_xdata()) <= set(np.unique(found.record.u))


@pytest.mark.ci
def test_a_long_record_is_shown_as_a_whole_and_in_part() -> None:
    shown = long()["over-time"].axes
    whole, part = (np.ptp(shown[place].get_xlim()) for place in (0, 2))
    assert len(shown) == 4
    assert part < whole / 4
    assert len(DISCREPANCY_FIGURES["over-time"](diagnosis()).axes) == 2


def test_where_nothing_was_found_there_is_no_after() -> None:
    clean = diagnosis(friction=0.0)
    assert clean.best is clean.base
    for draw in DISCREPANCY_FIGURES.values():
        texts = {text.get_text() for panel in draw(clean).axes for text in _legend(panel)}
        assert not texts & {"before", "after", "extended"}


def test_the_ladder_is_coloured_where_something_is_named() -> None:
    found = diagnosis()
    axes = draw_screening(found).axes[0]
    names = [text.get_text() for text in axes.get_yticklabels()]
    orange = [name for name, bar in zip(names, axes.patches, strict=True) if bar.get_facecolor()[0] > 0.8]
    assert orange == ["coulomb-friction"]
    assert names[-1] == found.candidates[0].name


@pytest.mark.ci
@pytest.mark.parametrize("name", DISCREPANCY_FIGURES)
def test_a_figure_is_small_enough_for_a_page(name: str, tmp_path) -> None:
    path = tmp_path / "figure.svg"
    save(long()[name], path)
    assert path.stat().st_size < 300_000


def _legend(panel):
    legend = panel.get_legend()
    return legend.get_texts() if legend else []
