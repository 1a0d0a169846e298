"""Analyses of the models of a result: equation, linear system, characteristic, step response."""

import numpy as np
import pytest

import islands

TWO = islands.make_model(
    [
        (islands.parse("y(k-1)"), 1.2),
        (islands.parse("y(k-2)"), -0.4),
        (islands.parse("u1(k-1)"), 0.5),
        (islands.parse("u2(k-1)*u2(k-3)"), 0.25),
    ],
    ("u_V+1", "v"),
    "y_um",
    0.1,
)


@pytest.mark.ci
def test_the_system_of_control_simulates_as_the_linear_model():
    import control

    system = islands.linearise(TWO, [0.0, 1.0])
    assert (system.dt, system.input_labels, system.output_labels) == (0.1, ["u_V", "v"], ["y_um"])
    rng = np.random.default_rng(0)
    u = 1e-4 * rng.normal(size=(2, 200))
    response = control.forced_response(system, inputs=u).outputs
    rest = float(islands.static_characteristic(TWO, [[0.0, 1.0]])[0])
    # Five samples at rest precede the inputs, because the free run reads them.
    signals = np.hstack([np.zeros((2, 5)), u]).T + np.array([0.0, 1.0])
    record = islands.Dataset(signals, np.full(205, rest), 0.1, ("u_V", "v"), "y_um")
    simulated = islands.simulate(TWO, record).y[5:] - rest
    assert np.abs(simulated - response).max() < 1e-6
    assert control.dcgain(system) == pytest.approx(np.array([[2.5, 2.5]]))


def test_a_response_is_drawn_into_the_axes_of_the_user(result):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.best.plot_step_response(0.0, 1.0, ax=left) is figure
    assert result.best.plot_static_characteristic([0.0, 1.0], ax=right) is figure
    assert right.get_lines()[0].get_ydata() == pytest.approx(result.best.static_characteristic([0.0, 1.0]))
