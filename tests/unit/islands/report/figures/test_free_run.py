"""Figure of a free run: measured and simulated output with units, and the residual below."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.report.figures.free_run import draw_free_run
from islands.report.figures.style import MEASURED, save
from islands.validation.prediction_bands import PredictionBand

if TYPE_CHECKING:
    from matplotlib.axes import Axes

pytestmark = pytest.mark.usefixtures("without_layout")


LONG = 40_000


def sine(periods: int, samples: int = 400, **changes: object) -> Dataset:
    u = np.sin(2 * np.pi * periods * np.arange(samples) / samples - 0.5)
    fields: dict[str, object] = {
        "input_names": ("u_V",),
        "output_name": "y_um",
        "input_units": ("V",),
        "output_unit": "um",
    }
    return Dataset(u, 3 * u, 0.01, **(fields | changes))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(LONG)


def curve(axes: "Axes", colour: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the line of the axes with a colour and more than two vertices."""
    from matplotlib.colors import to_hex

    (line,) = (
        item for item in axes.lines if to_hex(item.get_color()) == colour and len(item.get_xdata()) > 2
    )
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def test_segments_are_separated_and_not_joined():
    record = sine(3, segments=(150, 250))
    figure = draw_free_run(record, record.y)
    for axes in figure.axes:
        boundaries = [line.get_xdata()[0] for line in axes.lines if np.ptp(line.get_xdata()) == 0]
        assert boundaries == pytest.approx([1.495])
    x, y = curve(figure.axes[0], MEASURED)
    assert np.isnan(y[150])
    assert np.isnan(x[150])
    np.testing.assert_array_equal(np.delete(y, 150), record.y)


@pytest.mark.parametrize("y", [np.full(50, np.nan), np.zeros(50)])
def test_record_with_missing_or_constant_output_is_drawn(y, tmp_path):
    record = Dataset(np.arange(50.0), y, 1.0)
    save(draw_free_run(record, np.arange(50.0)), tmp_path / "odd.svg")
    save(draw_free_run(record, np.full(50, np.nan)), tmp_path / "odd.svg")


def test_simulation_of_another_length_raises_settings_error():
    with pytest.raises(SettingsError, match="one value for each of the record's 400 samples"):
        draw_free_run(sine(3), np.zeros(399))


def band_of(record: Dataset, half: np.ndarray) -> PredictionBand:
    return PredictionBand(0.9, record.y, record.y - half, record.y + half)


def shaded(axes: "Axes") -> np.ndarray:
    """Return the vertices of the only shaded band of the axes."""
    (band,) = axes.collections
    return band.get_paths()[0].vertices


def test_a_band_is_shaded_about_the_free_run_and_about_zero():
    record = sine(3)
    half = np.linspace(0.02, 0.05, record.samples)
    without = draw_free_run(record, record.y)
    above, below = draw_free_run(record, record.y, band=band_of(record, half)).axes
    for axes, centre in ((above, record.y), (below, np.zeros(record.samples))):
        drawn = {tuple(vertex) for vertex in shaded(axes).round(9)}
        for edge in (centre - half, centre + half):
            points = zip(record.time.round(9), edge.round(9), strict=True)
            assert sum(point in drawn for point in points) > 0.99 * record.samples
    assert [text.get_text() for text in above.get_legend().get_texts()][-1] == "90 % band"
    assert above.get_ylim() == without.axes[0].get_ylim()


def test_the_band_of_a_long_record_is_its_envelope():
    record = Dataset(noise(1), noise(2), 1e-3)
    half = np.full(LONG, 0.5)
    half[31_234] = 2.0
    vertices = shaded(draw_free_run(record, record.y, band=band_of(record, half)).axes[1])
    assert len(vertices) < 5000
    assert vertices[:, 1].max() == pytest.approx(2.0)
