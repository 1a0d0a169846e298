"""Frequency response of latent models as a figure."""

import numpy as np
import pytest

from islands.report.figures.bode import draw_bode
from support.latent_systems import make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("without_layout")]


def test_lines_are_the_response_up_to_the_nyquist_frequency():
    model = make_model(operating_inputs=(0.5,))
    figure = draw_bode(model, spring_record(100))
    above, below = figure.axes
    frequencies, magnitude = above.lines[0].get_data()
    response = model.linearise(model.rest).respond(frequencies * 0.01)[0]
    assert frequencies[-1] == 50.0
    assert magnitude == pytest.approx(np.abs(response))
    phase = below.lines[0].get_ydata()
    assert np.exp(1j * np.radians(phase)) == pytest.approx(response / np.abs(response))
    assert figure.get_suptitle() == "linear part about rest at u_V = 0.5"


def test_a_resonance_is_marked_with_its_damping_ratio():
    above, _ = draw_bode(make_model(), spring_record(100)).axes
    assert [text.get_text() for text in above.texts] == ["5.189 Hz, damping ratio 0.162"]
    mark = above.lines[1].get_xdata()
    assert mark == pytest.approx([5.189] * 2, rel=1e-3)
    frequencies, magnitude = above.lines[0].get_data()
    # Damping moves the peak of the magnitude below the frequency of the mode.
    assert frequencies[magnitude.argmax()] == pytest.approx(5.189, rel=0.1)
