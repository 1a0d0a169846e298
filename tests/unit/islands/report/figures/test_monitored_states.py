"""Figure of a monitor: panels and marks."""

import pytest

from islands.diagnosis.monitoring.record_follower import MonitorSettings, MonitorState
from islands.report.figures.monitored_states import draw_monitored_states
from support.monitored_oscillator import ONSET, follow, make_records, undisturbed_monitor


@pytest.mark.ci
def test_every_parameter_has_a_panel_and_an_alarm_a_mark():
    saved = follow(make_records(ONSET + 6, k=97.0)[ONSET:], undisturbed_monitor())
    figure = draw_monitored_states(saved.state)
    labels = [axes.get_ylabel().partition(" ")[0] for axes in figure.axes]
    assert labels[:3] == ["m", "c", "k"]
    assert labels[-2] == "noise"
    assert "k parameter changed" in [text.get_text() for text in figure.axes[0].texts]
    marks = [line for line in figure.axes[2].lines if line.get_linestyle() in ("-", ":")]
    assert len(marks) >= 2


def test_a_monitor_without_records_has_an_empty_figure():
    assert not draw_monitored_states(MonitorState(MonitorSettings(1e-3, 24))).axes
