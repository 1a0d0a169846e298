"""Figures of a diagnosis: panels, lines and sizes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import islands
from islands.effects.catalogue import get_title
from islands.report.figures.diagnosis import DIAGNOSIS_FIGURES, draw_residual, draw_screening
from islands.report.figures.style import save

pytestmark = pytest.mark.usefixtures("without_layout")

DT = 0.01


@cache
def diagnosis(friction: float = 0.3, levels: int = 0, samples: int = 900):
    """Return a diagnosis of a recorded simulation without dry friction; the input may be quantised."""
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
def residual_figure():
    """Return the figure of the residuals of the simulation and of the extended one."""
    return draw_residual(diagnosis())


@cache
def figures_of_long_record():
    """Return the figures of a diagnosis of a figures_of_long_record record, by name."""
    found = diagnosis(samples=6000)
    return {name: draw(found) for name, draw in DIAGNOSIS_FIGURES.items()}


def test_residual_figure_has_a_panel_per_signal() -> None:
    axes = residual_figure().axes
    assert [panel.get_xlabel() for panel in axes] == [
        "u (V)",
        "u (V)",
        "rate of the input (V/s)",
        "output of the best simulation (um)",
        "frequency (Hz)",
        "lag (s); shaded: white noise",
    ]
    # Both residuals are drawn, and all values are finite.
    for panel in axes:
        coloured = {line.get_color() for line in panel.lines}
        assert {"#c56fa0", "#d55e00"} <= coloured
        assert all(np.isfinite(line.get_xydata()).all() for line in panel.lines)


def divide(samples: int, boundary: int):
    """Return a diagnosis whose record consists of two recordings; the input of the second one is shifted."""
    found = diagnosis(samples=samples)
    u = np.array(found.record.u)
    u[boundary:] += 20.0
    return replace(found, record=replace(found.record, u=u, segments=(boundary, samples - boundary)))


@pytest.mark.ci
def test_lines_are_interrupted_between_recordings() -> None:
    divided = divide(900, 600)
    for name, panels in (("over-time", 3), ("loops", 2)):
        axes = DIAGNOSIS_FIGURES[name](divided).axes
        assert len(axes) == panels
        for line in [line for panel in axes for line in panel.lines if len(line.get_xdata()) > 2]:
            assert np.flatnonzero(np.isnan(line.get_xdata() + line.get_ydata())).size == 1
    # One boundary in each panel over time.
    shown = DIAGNOSIS_FIGURES["over-time"](divided).axes
    assert [line.get_xdata()[0] for panel in shown for line in panel.lines if len(line.get_xdata()) == 2] == [
        pytest.approx(599.5 * DT)
    ] * 2


@pytest.mark.ci
def test_residual_structure_does_not_reach_across_recordings() -> None:
    divided = draw_residual(divide(900, 600)).axes
    single = residual_figure().axes
    # The step of the input between the recordings is no rate.
    largest = [
        max(np.max(np.abs(line.get_xdata())) for line in each[2].lines[:2]) for each in (divided, single)
    ]
    assert largest[0] == pytest.approx(largest[1], rel=0.05)
    # Windows of a quarter of the longest recording resolve less than those of a quarter of the record.
    assert len(divided[4].lines[0].get_xdata()) == 75
    assert len(single[4].lines[0].get_xdata()) == 112


def test_dry_friction_separates_the_directions_only_before_extension() -> None:
    lines = residual_figure().axes[1].lines[:-1]
    mean = {
        (line.get_color(), line.get_linestyle()): np.mean(line.get_ydata())
        for line in lines
        if len(line.get_ydata()) > 2
    }
    before = mean["#c56fa0", "-"] - mean["#c56fa0", "--"]
    after = mean["#d55e00", "-"] - mean["#d55e00", "--"]
    assert before == pytest.approx(-0.6, abs=0.05)
    assert after == pytest.approx(0.0, abs=0.05)


def test_spectrum_integrates_to_the_variance_of_the_residual() -> None:
    found = diagnosis()
    before = residual_figure().axes[4].lines[0]
    frequency, density = before.get_xydata().T
    residual = found.record.y - found.base.output
    assert np.trapezoid(density**2, frequency) == pytest.approx(np.var(residual), rel=0.25)


@pytest.mark.ci
def test_input_with_few_levels_has_no_empty_cells() -> None:
    """An empty cell has no mean; zero would look like a residual that vanishes."""
    found = diagnosis(levels=2)
    over_input = draw_residual(found).axes[0].lines[0]
    assert set(over_input.get_xdata()) <= set(np.unique(found.record.u))


@pytest.mark.ci
def test_long_record_is_shown_completely_and_in_a_section() -> None:
    shown = figures_of_long_record()["over-time"].axes
    whole, part = (np.ptp(shown[place].get_xlim()) for place in (0, 2))
    assert len(shown) == 5
    assert part < whole / 4
    assert len(DIAGNOSIS_FIGURES["over-time"](diagnosis()).axes) == 3


def test_diagnosis_without_effects_has_no_lines_after_extension() -> None:
    clean = diagnosis(friction=0.0)
    assert clean.best is clean.base
    for draw in DIAGNOSIS_FIGURES.values():
        texts = {text.get_text() for panel in draw(clean).axes for text in _legend(panel)}
        assert not texts & {"extended"}


def test_screening_figure_colours_the_named_effects() -> None:
    found = diagnosis()
    axes = draw_screening(found).axes[0]
    names = [text.get_text() for text in axes.get_yticklabels()]
    orange = [name for name, bar in zip(names, axes.patches, strict=True) if bar.get_facecolor()[0] > 0.8]
    assert orange == ["dry friction"]
    assert names[-1] == get_title(found.candidates[0].name)


@pytest.mark.ci
@pytest.mark.parametrize("name", DIAGNOSIS_FIGURES)
def test_figure_files_are_smaller_than_300_kilobytes(name: str, tmp_path) -> None:
    path = tmp_path / "figure.svg"
    save(figures_of_long_record()[name], path)
    assert path.stat().st_size < 300_000


def _legend(panel):
    legend = panel.get_legend()
    return legend.get_texts() if legend else []
