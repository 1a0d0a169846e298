"""Analyses of the models of a result: equation, linear system, characteristic, step response."""

import pytest


def test_a_response_is_drawn_into_the_axes_of_the_user(result):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.best.plot_step_response(0.0, 1.0, ax=left) is figure
    assert result.best.plot_static_characteristic([0.0, 1.0], ax=right) is figure
    assert right.get_lines()[0].get_ydata() == pytest.approx(result.best.static_characteristic([0.0, 1.0]))
