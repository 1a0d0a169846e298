"""Linear systems: responses, conversions, hand-over, resonances and their statement."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

import islands
from islands.models.state_space import FORMS, StateSpace, describe_poles, find_resonances
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model


def lag_of_two_inputs():
    """2 * 0.5 / (z - 0.9) of the first input, 0.3 of the second."""
    return StateSpace(
        A=np.array([[0.9]]), B=np.array([[0.5, 0.0]]), C=np.array([[2.0]]), D=np.array([[0.0, 0.3]]), dt=0.1
    )


def make_integrator():
    return StateSpace(A=np.eye(1), B=np.ones((1, 1)), C=np.ones((1, 1)), D=np.zeros((1, 1)))


def make_random(order, inputs, outputs, seed):
    """A stable system without poles near zero or the negative axis."""
    rng = np.random.default_rng(seed)
    rates = -rng.uniform(0.05, 1.0, order)
    A = scipy.linalg.expm(np.diag(rates) + np.triu(0.4 * rng.standard_normal((order, order)), 1))
    A[:2, :2] = 0.9 * np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    B, C = rng.standard_normal((order, inputs)), rng.standard_normal((outputs, order))
    return StateSpace(
        A=A,
        B=B,
        C=C,
        D=np.zeros((outputs, inputs)),
        dt=0.2,
        input_names=tuple(f"u{i}" for i in range(inputs)),
        output_names=tuple(f"y{i}" for i in range(outputs)),
    )


RANDOM = [
    make_random(order, inputs, outputs, seed)
    for seed, (order, inputs, outputs) in enumerate([(2, 1, 1), (3, 2, 1), (4, 1, 2), (6, 3, 3)])
]


def test_a_first_order_lag_has_the_response_of_its_formula():
    z = np.exp(2j * np.pi * np.array([0.0, 0.1, 0.5]))
    response = lag_of_two_inputs().respond([0.0, 1.0, 5.0])[0]
    assert response[0] == pytest.approx(1.0 / (z - 0.9))
    assert response[1] == pytest.approx(np.full(3, 0.3))


def test_an_undamped_mode_has_no_response_at_its_frequency():
    at_rest, moving = make_integrator().respond(np.array([0.0, 0.5]))[0, 0]
    assert np.isnan(at_rest)
    assert moving == pytest.approx(-0.5)


def test_a_dead_time_turns_the_phase_and_delays_the_step():
    system = replace(lag_of_two_inputs(), dead_times=(0.5, 0.0))
    ratio = system.respond([0.3])[0] / lag_of_two_inputs().respond([0.3])[0]
    assert ratio[:, 0] == pytest.approx([np.exp(-2j * np.pi * 0.3 * 0.5), 1.0])
    late, at_once = system.step_response(9).values[0]
    assert late == pytest.approx([0.0] * 6 + [1.0, 1.9, 2.71])
    assert at_once == pytest.approx(np.full(9, 0.3))


@pytest.mark.parametrize("system", RANDOM)
def test_delays_as_states_do_not_change_the_responses(system):
    late = replace(system, dead_times=(0.4,) + (0.0,) * (len(system.input_names) - 1))
    frequencies, expanded = np.array([0.0, 0.7, 2.4]), late.expand_delays()
    assert expanded.respond(frequencies) == pytest.approx(late.respond(frequencies), rel=1e-12, abs=1e-12)
    assert expanded.step_response(30).values == pytest.approx(late.step_response(30).values, abs=1e-12)


@pytest.mark.parametrize("method", ["zoh", "tustin"])
@pytest.mark.parametrize("system", RANDOM)
def test_the_continuous_system_has_these_samples(system, method):
    continuous = system.to_continuous(method)
    again = continuous.to_discrete(0.2, method)
    for name in "ABCD":
        assert getattr(again, name) == pytest.approx(getattr(system, name), rel=1e-12, abs=1e-12)
    assert continuous.static_gain == pytest.approx(system.static_gain, rel=1e-9)
    if method == "zoh":
        assert np.sort_complex(continuous.poles) == pytest.approx(np.sort_complex(system.rates), abs=1e-9)


def test_a_delay_has_no_continuous_counterpart():
    late = replace(lag_of_two_inputs(), dead_times=(0.5, 0.0)).expand_delays()
    with pytest.raises(islands.ModelError, match="Hand over the discrete system"):
        late.to_continuous()
    assert late.to_continuous("tustin").static_gain == pytest.approx(late.static_gain)


@pytest.mark.parametrize("system", RANDOM)
def test_zeros_block_the_input(system):
    for output, channel in np.ndindex(system.D.shape):
        single = system.select(output, channel)
        for zero in single.zeros:
            solved = np.linalg.solve(zero * np.eye(single.order) - single.A, single.B)
            scale = np.abs(single.C).max() * np.abs(solved).max()
            assert np.abs(single.C @ solved + single.D).max() <= 1e-6 * scale


@pytest.mark.ci
@pytest.mark.parametrize("dead_time", [0.0, 0.6])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("system", RANDOM)
def test_python_control_has_the_same_system(system, form, dead_time):
    control = pytest.importorskip("control")
    inputs = len(system.input_names)
    system = replace(system, dead_times=(dead_time,) * inputs)
    theirs = system.to_control(form)
    frequencies = np.array([0.03, 0.4, 1.7, 2.45])
    found = theirs(np.exp(2j * np.pi * 0.2 * frequencies), squeeze=False)
    assert found == pytest.approx(system.respond(frequencies), rel=1e-12, abs=1e-12)
    assert (theirs.dt, theirs.input_labels) == (0.2, list(system.input_names))
    if form == "state-space":
        step = np.outer(np.eye(inputs)[0], np.ones(40))
        response = control.forced_response(theirs, 0.2 * np.arange(40), step, squeeze=False)
        assert response.outputs == pytest.approx(system.step_response(40).values[:, 0], abs=1e-12)


@pytest.mark.ci
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("system", RANDOM)
def test_python_control_has_the_same_continuous_system(system, form):
    """Its samples at held inputs are the discrete system again."""
    control = pytest.importorskip("control")
    continuous = system.to_continuous()
    theirs = continuous.to_control(form)
    frequencies = np.array([0.03, 0.4, 1.7, 2.45])
    found = theirs(2j * np.pi * frequencies, squeeze=False)
    assert found == pytest.approx(continuous.respond(frequencies), rel=1e-12, abs=1e-12)
    assert (theirs.dt, theirs.input_labels) == (0.0, list(system.input_names))
    if form == "state-space":
        sampled = control.sample_system(theirs, 0.2, "zoh")
        for name in "ABCD":
            assert getattr(sampled, name) == pytest.approx(getattr(system, name), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("system", RANDOM)
def test_the_pade_approximation_is_the_dead_time_at_low_frequencies(system):
    late = replace(system, dead_times=(0.4, 0.2, 0.0)[: len(system.input_names)]).to_continuous()
    frequencies = np.array([0.0, 0.1, 0.7 / 0.4])
    exact = late.respond(frequencies)
    for order, errors in ((1, [1e-12, 2e-3, 2.0]), (4, [1e-12, 1e-9, np.radians(1.0)])):
        found = late.expand_delays(pade=order)
        assert found.order == late.order + order * np.count_nonzero(late.delays)
        assert np.abs(found.respond(frequencies)) == pytest.approx(np.abs(exact), rel=1e-9, abs=1e-12)
        assert (np.abs(found.respond(frequencies) - exact) <= np.multiply(errors, np.abs(exact).max())).all()
    with pytest.raises(islands.ModelError, match="pade=4"):
        late.expand_delays()


@pytest.mark.parametrize("system", RANDOM)
def test_a_continuous_system_is_described_as_the_discrete_one(system):
    late = replace(system, dead_times=(0.4,) * len(system.input_names))
    assert late.to_continuous().describe() == late.describe()
    integrator = replace(make_integrator(), dt=0.1, input_names=("u",), output_names=("y",)).to_continuous()
    assert integrator.describe() == ("a mode that does not decay (pole 0)",)


def test_the_band_of_equal_members_is_the_response():
    system = RANDOM[0]
    same = replace(system, members=(system,) * 3, weights=(0.2, 0.3, 0.5)).frequency_response([0.1, 1.0])
    for limit in same.band(0.9):
        assert limit == pytest.approx(np.abs(same.values))
    with pytest.raises(islands.ModelError, match="uncertainty of this system is not known"):
        system.frequency_response([0.1]).band()


def test_damping_and_natural_frequency_are_those_of_each_pole():
    rate = 2.0 * np.pi * 0.5 * (-0.1 + 1j * np.sqrt(1.0 - 0.1**2))
    turn = np.exp(0.2 * rate)
    A = np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])
    system = StateSpace(A=A, B=np.ones((2, 1)), C=np.ones((1, 2)), D=np.zeros((1, 1)), dt=0.2)
    for each in (system, system.to_continuous()):
        assert each.natural_frequencies == pytest.approx([0.5, 0.5])
        assert each.damping == pytest.approx([0.1, 0.1])
        assert each.is_stable
    assert not make_integrator().is_stable


def test_resonances_are_those_of_the_continuous_system():
    rate = 2.0 * np.pi * 5.0 * (-0.1 + 1j * np.sqrt(1.0 - 0.1**2))
    poles = np.exp(0.01 * np.array([rate, rate.conjugate(), -2.0]))
    ((frequency, damping),) = find_resonances(poles, 0.01)
    assert (frequency, damping) == pytest.approx((5.0, 0.1))
    assert describe_poles(poles, 0.01) == (
        "time constant 0.5 s",
        "resonance at 5 Hz with a damping ratio of 0.1",
    )


def test_standard_errors_of_modes_are_stated_in_their_order():
    poles = [np.exp(-0.01 / 0.5), 0.5 + 0.5j, 0.5 - 0.5j, 0.0, -0.3, 1.1]
    assert describe_poles(poles, 0.01, (0.001, 0.02, 0.31, 0.0123, 0.004)) == (
        "a mode that does not decay (pole 1.1 +- 0.001)",
        "time constant 0.5 +- 0.02 s",
        "resonance at 13.66 +- 0.31 Hz with a damping ratio of 0.404 +- 0.012",
        "an alternating mode (pole -0.3 +- 0.004)",
        "a delay of one sample",
    )


def test_the_static_gain_is_the_response_at_rest():
    lag = lag_of_two_inputs()
    assert lag.static_gain == pytest.approx(lag.respond([0.0])[..., 0].real)
    assert np.isnan(make_integrator().static_gain).all()


@pytest.mark.ci
@pytest.mark.parametrize("frequency", [0.02, 0.0525, 0.2])
def test_the_response_at_rest_is_the_ratio_of_a_small_sine(frequency):
    """The spring is stiffer at the operating point, and the output reads the input at once."""
    wiring = {**dict(list(SPRING.items())[:7]), "d": 0.4, **dict(list(SPRING.items())[7:])}
    model = make_model(wiring, input_names=("u_V+1",), operating_inputs=(1.5,))
    time, amplitude = np.arange(4000), 1e-4
    sine = np.exp(2j * np.pi * frequency * time)
    u = 1.5 + amplitude * sine.real
    rest = 1.2 * model.rest[0] + 0.3 + 0.4 * 1.5
    record = Dataset(u, np.full(len(u), rest), 0.01, ("u_V",), "y_mm")
    y = free_run(model, record).y[2000:]
    basis = np.column_stack([sine[2000:].real, sine[2000:].imag, np.ones(2000)])
    cosine, quadrature, _ = np.linalg.lstsq(basis, y, rcond=None)[0]
    response = model.linearise().respond([frequency / 0.01])[0, 0, 0]
    assert (cosine - 1j * quadrature) / amplitude == pytest.approx(response, rel=1e-3)


@pytest.mark.parametrize("mixed", [np.eye(3), np.array([[1.0, 0.4, 0.2], [-0.3, 1.0, 0.5], [0.1, 0.2, 1.0]])])
@pytest.mark.parametrize(("count", "name"), [(1, "integrator gain"), (2, "double integrator gain")])
def test_gain_of_integrators_is_that_to_the_slope_or_the_curvature(mixed, count, name):
    a = np.array([[1.0, 0.1, 0.0], [0.0, 1.0 if count == 2 else 0.6, 0.0], [0.0, 0.0, 0.9]])
    b, c = np.array([[0.005], [0.1], [1.0]]), np.array([[3.0, 0.0, 1.0]])
    inverse = np.linalg.inv(mixed)
    system = StateSpace(A=mixed @ a @ inverse, B=mixed @ b, C=c @ inverse, D=np.zeros((1, 1)), dt=0.1)
    x, y = np.zeros(3), np.zeros(400)
    for k in range(y.size):
        y[k] = system.C[0] @ x
        x = system.A @ x + system.B[:, 0]
    (gain,) = [each.value for each in system.quantities if each.name == name]
    assert gain == pytest.approx(np.diff(y, count)[-1] / 0.1**count, rel=1e-4)
