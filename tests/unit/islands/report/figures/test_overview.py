import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.record_facts import measure_facts
from islands.report.figures.overview import draw_overview
from support.known_records import delay, lag, measure, steps, white


def draw(record, theme="light"):
    return draw_overview(record, measure_facts(record), theme)


@pytest.fixture(scope="module")
def record():
    u = steps(800, 0, 8)
    return measure(u, delay(lag(u, 4.0), 3), 0.02, dt=0.1)


def test_dead_time_is_marked_in_the_impulse_response(record):
    axes = draw(record).axes[-1]
    assert [text.get_text() for text in axes.texts] == ["dead time 4"]
    response = axes.lines[0].get_ydata()
    assert np.argmax(response > 0.5 * response.max()) == 4


def test_input_that_does_not_excite_has_no_impulse_response():
    u = np.sin(0.02 * np.arange(1000))
    figure = draw(measure(u, lag(u, 20.0)))
    assert "no impulse response" in figure.axes[-1].texts[0].get_text()


def test_constant_signals_and_missing_outputs_are_drawn():
    y = white(300, 0)
    y[50:60] = np.nan
    assert draw(Dataset(np.ones(300), y, 1.0)).axes
