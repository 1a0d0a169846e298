"""Figures of linear systems."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import ModelError
from islands.models.state_space import StateSpace
from islands.report.figures.linear_system import LINEAR_FIGURES, draw_bode, draw_linear_system, draw_pole_map
from support.latent_systems import make_model

# The kernels of state spaces are compiled at their first use.
pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("without_layout")]


def test_lines_are_the_response_up_to_the_nyquist_frequency():
    model = make_model(operating_inputs=(0.5,))
    figure = draw_bode(model.linearise())
    above, below = figure.axes
    frequencies, magnitude = above.lines[0].get_data()
    response = model.linearise().respond(frequencies)[0, 0]
    assert frequencies[-1] == 50.0
    assert magnitude == pytest.approx(np.abs(response))
    phase = below.lines[0].get_ydata()
    assert np.exp(1j * np.radians(phase)) == pytest.approx(response / np.abs(response))
    assert figure.get_suptitle() == "linear part about u_V = 0.5"


def test_a_resonance_is_marked_with_its_damping_ratio():
    above, _ = draw_bode(make_model().linearise()).axes
    assert [text.get_text() for text in above.texts] == ["5.189 Hz, damping ratio 0.162"]
    mark = above.lines[1].get_xdata()
    assert mark == pytest.approx([5.189] * 2, rel=1e-3)
    frequencies, magnitude = above.lines[0].get_data()
    # Damping moves the peak of the magnitude below the frequency of the mode.
    assert frequencies[magnitude.argmax()] == pytest.approx(5.189, rel=0.1)


def test_each_output_has_its_panels_and_a_common_resonance_is_marked_once():
    one = make_model().linearise()
    A, C = (np.kron(np.eye(2), each) for each in (one.A, one.C))
    B, D = (np.tile(each, (2, 1)) for each in (one.B, one.D))
    names = {"output_names": ("a", "b"), "output_units": ("m", "N"), "operating_outputs": (0.0, 0.0)}
    both = replace(one, A=A, B=B, C=C, D=D, **names)
    first, _, second, _ = draw_bode(both).axes
    assert [len(axes.texts) for axes in (first, second)] == [1, 0]
    assert "(N/" in second.get_ylabel()
    assert first.lines[0].get_ydata() == pytest.approx(second.lines[0].get_ydata())
    assert len(draw_linear_system(both, "unit-step").axes) == 2
    mode, gain = one.describe()
    assert both.describe() == (mode, f"{gain} on a", f"{gain} on b")


@pytest.mark.parametrize("kind", LINEAR_FIGURES)
def test_bands_are_drawn_of_a_system_whose_uncertainty_is_known(kind):
    system = make_model().linearise()
    members = tuple(replace(system, B=factor * system.B, members=()) for factor in (0.8, 1.0, 1.2))
    unsure = replace(system, members=members, weights=(1 / 3,) * 3)
    axes = [draw_linear_system(each, kind).axes[0] for each in (system, unsure)]
    without, with_bands = (len(each.lines) + len(each.collections) for each in axes)
    assert with_bands > without


def test_a_static_system_has_no_figure():
    model = make_model({"d": 2.0, "level": 1.0}, (), 0, input_names=("u+1",))
    with pytest.raises(ModelError, match="take the figure static-curve"):
        draw_linear_system(model.linearise())


def test_a_far_zero_is_named_and_does_not_set_the_scale_of_the_poles():
    zero = -40.0
    system = StateSpace(
        A=np.array([[1.5, -0.56], [1.0, 0.0]]),
        B=np.array([[1.0], [0.0]]),
        C=np.array([[1.0, -zero]]),
        D=np.zeros((1, 1)),
        dt=0.1,
    )
    assert system.zeros == pytest.approx([zero])
    axes = draw_pole_map(system).axes[0]
    assert "zeros (outside: -40)" in [text.get_text() for text in axes.get_legend().get_texts()]
    assert axes.get_xlim()[0] > zero
