"""Figures of a diagnosis: panels, lines and sizes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import islands
from islands.diagnosis.rate_effect import find_rate_effect
from islands.effects.catalogue import CATALOGUE
from islands.report.figures.diagnosis import BEFORE, draw_residual, draw_residual_over_rate
from islands.report.figures.style import SIMULATED

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


FRICTION = 0.3


@cache
def diagnose_shifted(friction: float = FRICTION):
    """Return a diagnosis of a recorded simulation without dry friction, whose output has an offset."""
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(500)
    u = 4 * np.sin(3 * time) * np.sin(0.8 * time + 0.5)
    simulated = 1.5 * u
    y = 0.2 + simulated - friction * np.sign(np.gradient(u)) + 0.05 * rng.standard_normal(time.size)
    record = islands.Dataset(u[:, None], y, 0.01, ("u_V",), "y_um", ("V",), "um")
    effects = [CATALOGUE[name] for name in ("coulomb-friction", "offset")]
    return islands.diagnose(record, "column:y_sim", columns={"y_sim": simulated}, effects=effects)


@pytest.mark.ci
def test_the_residual_without_friction_is_a_step_over_the_rate_and_with_it_none() -> None:
    above, below = draw_residual_over_rate(diagnose_shifted()).axes
    lines = {line.get_color(): line for line in above.lines if line.get_color() in (BEFORE, SIMULATED)}
    for colour, step in ((BEFORE, -FRICTION), (SIMULATED, 0.0)):
        rate, mean = lines[colour].get_data()
        ends = [np.mean(mean[side * rate > 0.3 * np.max(rate)]) for side in (1.0, -1.0)]
        np.testing.assert_allclose(ends, [step, -step], atol=0.03)
    places, force = below.lines[0].get_data()
    np.testing.assert_allclose(np.interp([-5.0, 5.0], places, force), [-FRICTION, FRICTION], atol=0.02)
    assert (below.get_xlabel(), below.get_ylabel()) == ("rate of u (V/s)", "added (um)")


def test_the_effect_is_named_in_plain_words() -> None:
    figure = draw_residual_over_rate(diagnose_shifted())
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "without dry friction",
        "with dry friction",
    ]


def test_a_cause_that_is_not_claimed_or_has_no_rate_has_no_figure() -> None:
    found = diagnose_shifted()
    assert find_rate_effect(found).name == "coulomb-friction"
    unclaimed = replace(found, effects=tuple(replace(each, is_claimed=False) for each in found.effects))
    assert find_rate_effect(unclaimed) is None
    assert find_rate_effect(diagnose_shifted(0.0)) is None
    with pytest.raises(ValueError, match="no claimed effect"):
        draw_residual_over_rate(diagnose_shifted(0.0))
