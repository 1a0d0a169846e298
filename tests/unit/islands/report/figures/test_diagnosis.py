"""Figures of a diagnosis: panels, lines and sizes."""

from functools import cache

import numpy as np
import pytest

import islands
from islands.report.figures.diagnosis import draw_residual

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


def test_spectrum_integrates_to_the_variance_of_the_residual() -> None:
    found = diagnosis()
    before = residual_figure().axes[4].lines[0]
    frequency, density = before.get_xydata().T
    residual = found.record.y - found.base.output
    assert np.trapezoid(density**2, frequency) == pytest.approx(np.var(residual), rel=0.25)
