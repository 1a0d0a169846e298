"""Figure of hysteresis loops: panels, number of loops, divergence and file size."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.report.figures.hysteresis import draw_loop
from islands.report.figures.style import MEASURED, SIMULATED

pytestmark = pytest.mark.usefixtures("without_layout")


def loops(periods: int, inputs: int = 1, length: int = 200, **changes: object) -> Dataset:
    angle = 2 * np.pi * np.arange(periods * length) / length - 0.5
    u = np.column_stack([(channel + 1) * np.sin(angle + channel) for channel in range(inputs)])
    names, units = tuple(f"u{channel}_V" for channel in range(inputs)), ("V",) * inputs
    return Dataset(u, np.sin(angle - 0.3), 0.01, names, "y_um", units, "um", **changes)


@pytest.mark.parametrize("inputs", [1, 2, 3, 4])
def test_inputs_have_one_panel_each_with_name_and_unit(inputs):
    from matplotlib.colors import to_hex

    record = loops(3, inputs)
    figure = draw_loop(record, 0.9 * record.y, "title")
    assert [axes.get_xlabel() for axes in figure.axes] == [f"u{channel} (V)" for channel in range(inputs)]
    assert figure.axes[0].get_ylabel() == "y (um)"
    assert figure.get_suptitle() == "title"
    for channel, axes in enumerate(figure.axes):
        measured, simulated = axes.lines
        assert (to_hex(measured.get_color()), to_hex(simulated.get_color())) == (MEASURED, SIMULATED)
        np.testing.assert_array_equal(measured.get_xdata(), record.u[:, channel])
        np.testing.assert_array_equal(measured.get_ydata(), record.y)
        np.testing.assert_array_equal(simulated.get_ydata(), 0.9 * record.y)
