from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.errors import RecordError
from islands.estimation.linear.identify import identify_linear, identify_orders
from islands.progress import Steps, StoppedError
from support.latent_systems import curves_record

# A search takes more than half a second of CPU.
pytestmark = pytest.mark.ci


def steps(random, samples, inputs=1, hold=25):
    levels = random.uniform(-1.0, 1.0, (samples // hold + 1, inputs))
    return np.repeat(levels, hold, axis=0)[:samples]


def first_order(u, gain, pole, delay):
    return lfilter(np.r_[np.zeros(delay + 1), gain * (1.0 - pole)], [1.0, -pole], u)


def find(model, name, place=None, output=0):
    rows = zip(model.quantities[output], model.errors[output], strict=True)
    return next((each.value, error) for each, error in rows if each.name == name and each.input == place)


@pytest.fixture(scope="module")
def two_inputs():
    random = np.random.default_rng(1)
    u = steps(random, 500, 2)
    y = 20.0 + first_order(u[:, 0], 1.5, 0.87, 2) + first_order(u[:, 1], -2.0, 0.87, 9)
    return u, y + random.normal(0.0, 0.02, 500)


@pytest.fixture(scope="module")
def model(two_inputs):
    return identify_linear(*two_inputs, max_order=2, max_dead_time=12)


def test_order_and_dead_times_are_those_of_the_system(model):
    assert model.order == 1
    assert model.delays.tolist() == [[2, 9]]


@pytest.mark.parametrize(
    ("name", "place", "true"),
    [("time constant", None, -1.0 / np.log(0.87)), ("static gain", 1, 1.5), ("static gain", 2, -2.0)],
)
def test_true_values_are_within_three_standard_errors(model, name, place, true):
    value, error = find(model, name, place)
    assert 0.0 < error < 0.02 * abs(true)
    assert abs(value - true) < 3.0 * error


def test_units_of_signals_and_time_scale_the_values(two_inputs, model):
    u, y = two_inputs
    other = identify_linear(1e3 * u + 7.0, 1e-4 * y, 60.0, max_order=2, max_dead_time=12)
    for name, place, factor in (
        ("time constant", None, 60.0),
        ("static gain", 2, 1e-7),
        ("dead time", 2, 60.0),
    ):
        np.testing.assert_allclose(
            find(other, name, place), np.multiply(find(model, name, place), factor), 1e-5
        )


def test_simulation_leaves_the_noise(two_inputs, model):
    u, y = two_inputs
    error = model.simulate(u)[80:, 0] - y[80:]
    assert np.std(error) == pytest.approx(0.02, rel=0.1)
    assert model.deviations[0] == pytest.approx(0.02, rel=0.1)


def test_simulation_has_any_unit_of_the_output(two_inputs, model):
    y = model.simulate(two_inputs[0])
    scaled = {name: 1e9 * getattr(model, name) for name in ("b", "d", "drift", "y0")}
    np.testing.assert_allclose(replace(model, **scaled).simulate(two_inputs[0]), 1e9 * y, rtol=1e-9)


def test_state_space_has_the_gains_and_the_dead_times(model):
    system = model.state_space()
    assert system.dead_times == (2.0, 9.0)
    gains = [find(model, "static gain", place)[0] for place in (1, 2)]
    np.testing.assert_allclose(system.static_gain, [gains], 1e-9)


def test_one_output_is_a_special_case_of_several(two_inputs, model):
    u, y = two_inputs
    both = identify_linear(u, np.column_stack([y, -3.0 * y]), max_order=1, max_dead_time=12)
    assert both.delays.tolist() == [[2, 9], [2, 9]]
    for name, place in (("time constant", None), ("static gain", 1)):
        value, error = find(model, name, place)
        # The levels of the inputs before the record cost half as much.
        assert find(both, name, place)[0] == pytest.approx(value, abs=0.2 * error)
    np.testing.assert_allclose(
        find(both, "static gain", 1, 1)[0], -3.0 * find(both, "static gain", 1)[0], 1e-6
    )


def test_inputs_may_have_poles_of_their_own():
    random = np.random.default_rng(5)
    u = steps(random, 600, 2)
    u[0] = 0.0
    y = first_order(u[:, 0], 1.5, 0.9, 3) + first_order(u[:, 1], -2.0, 0.8, 1)
    model = identify_linear(u, y + random.normal(0.0, 0.02, 600), max_order=4, max_dead_time=8)
    assert model.delays.tolist() == [[3, 1]]
    np.testing.assert_allclose(np.sort(model.poles.real), [0.8, 0.9], atol=0.01)
    # The response to each input has one of the poles.
    assert np.count_nonzero(model.b) == 2


def test_recordings_with_other_initial_states_have_one_law():
    random = np.random.default_rng(2)
    u = steps(random, 400)
    y = first_order(u[:, 0], 2.0, 0.9, 0)
    y[200:] = first_order(u[200:, 0], 2.0, 0.9, 0) + 5.0 * 0.9 ** np.arange(200)
    found = identify_linear(u, y + random.normal(0.0, 0.01, 400), 1.0, (200, 200), max_order=2)
    value, error = find(found, "static gain", 1)
    assert found.order == 1
    assert abs(value - 2.0) < 3.0 * error


def test_integrator_has_a_pole_at_exactly_one():
    random = np.random.default_rng(3)
    u = steps(random, 300)
    y = np.concatenate([[0.0], np.cumsum(0.2 * (u[:-1, 0] - 0.1))])
    found = identify_linear(u, y + random.normal(0.0, 0.05, 300), max_order=2)
    value, error = find(found, "integrator gain", 1)
    assert found.poles.tolist() == [1.0]
    assert abs(value - 0.2) < 3.0 * error


def test_two_integrators_have_poles_at_exactly_one():
    random = np.random.default_rng(1)
    u = steps(random, 600, hold=15)
    u -= u.mean()
    speed = np.concatenate([[0.0], np.cumsum(0.03 * u[:-1, 0])])
    y = 5.0 + np.concatenate([[0.0], np.cumsum(0.01 * speed[:-1] + 1.5e-4 * u[:-1, 0])])
    found = identify_linear(u, y + random.normal(0.0, 2e-3 * y.std(), 600), 0.01, max_order=3)
    value, error = find(found, "double integrator gain", 1)
    np.testing.assert_allclose(found.poles, [1.0, 1.0], atol=1e-7)
    assert abs(value - 3.0) < 3.0 * error


def test_disturbance_of_the_states_is_noise_and_no_further_mode():
    random = np.random.default_rng(2)
    u, poles = steps(random, 800), [1.0, -1.94, 0.952]
    driven = u[:, 0] + random.normal(0.0, 0.5, 800)
    y = lfilter([0.0, 0.006, 0.006], poles, driven) + random.normal(0.0, 0.01, 800)
    found = identify_linear(u, y, max_order=5)
    assert found.order == 2
    assert found.noise[0].shape[1] > 0


def test_input_may_jump_at_the_first_sample_before_its_dead_time():
    random = np.random.default_rng(7)
    u = 3.0 + steps(random, 500)
    y = first_order(u[:, 0], 2.0, 0.9, 14)  # from rest with an input of 0
    found = identify_linear(u, y + random.normal(0.0, 0.02, 500), max_order=1, max_dead_time=20)
    value, error = find(found, "static gain", 1)
    assert found.delays.tolist() == [[14]]
    assert abs(value - 2.0) < 3.0 * error


def test_dead_time_of_a_fraction_of_a_sample_is_found():
    random = np.random.default_rng(4)
    u, pole, late = steps(random, 600), np.exp(-0.1), np.exp(-0.1 * 0.4)  # 3.6 samples
    y = lfilter([0.0, 0.0, 0.0, 1.0 - late, late - pole], [1.0, -pole], u[:, 0])
    found = identify_linear(u, y + random.normal(0.0, 0.002, 600), max_order=2)
    value, error = find(found, "dead time", 1)
    assert found.order == 1
    assert 0.0 < error < 0.05
    assert abs(value - 2.6) < 3.0 * error


def test_static_gain_has_order_zero():
    random = np.random.default_rng(5)
    u = steps(random, 200, hold=3)
    found = identify_linear(u, 4.0 * u[:, 0] + 1.0 + random.normal(0.0, 0.1, 200), max_order=2)
    value, error = find(found, "static gain", 1)
    assert found.order == 0
    assert abs(value - 4.0) < 3.0 * error


def test_direct_path_does_not_hide_slow_modes():
    random = np.random.default_rng(8)
    u = steps(random, 1000)
    slow = first_order(u[:, 0], 0.5, 0.95, 0) + np.concatenate([[0.0], np.cumsum(0.01 * u[:-1, 0])])
    found = identify_linear(u, 2.0 * u[:, 0] + slow + random.normal(0.0, 0.01, 1000), feedthrough=True)
    value, error = find(found, "integrator gain", 1)
    assert found.order == 2
    assert found.poles.max() == 1.0
    assert found.d[0, 0] == pytest.approx(2.0, abs=0.01)
    assert abs(value - 0.01) < 3.0 * error


def test_resonance_is_found_from_a_decay():
    random = np.random.default_rng(6)
    k, u = np.arange(300), np.zeros((300, 1))
    y = np.exp(-0.02 * k) * np.cos(0.5 * k) + random.normal(0.0, 0.01, 300)
    found = identify_linear(u, y, 0.01, max_order=2)
    rate = abs(complex(-0.02, 0.5)) / 0.01
    value, error = find(found, "frequency")
    assert abs(value - rate / (2.0 * np.pi)) < 3.0 * error


def test_stop_ends_a_search_after_the_orders_that_it_has_reported():
    random = np.random.default_rng(7)
    u, told = steps(random, 200), []
    y = first_order(u[:, 0], 1.0, 0.8, 0) + random.normal(0.0, 0.01, 200)
    watched = Steps(lambda message, _fraction=None: told.append(message), lambda: len(told) == 2)
    with pytest.raises(StoppedError):
        identify_linear(u, y, steps=watched)
    assert told == ["linear model of order 1", "linear model of order 2"]


def test_search_ends_if_a_dead_time_reduces_the_error_and_not_the_criterion():
    # The curves of this record give a later dead time a slightly smaller error.
    record, changes = curves_record(300, 1).records[1], []

    def report(message, _fraction=None):
        changes.extend([message] if message.startswith("changes") else [])

    watched = Steps(report, lambda: len(changes) > 20)
    found = identify_linear(record.u[:225], record.y[:225], 0.01, feedthrough=False, steps=watched)
    assert found.delays[0][0] == 0


@pytest.mark.ci
def test_many_recordings_of_a_long_record_have_inputs_of_their_own_before_them():
    random, lengths = np.random.default_rng(8), (3000, 3000, 1000)
    u = np.concatenate([steps(random, each) for each in lengths])
    starts = np.cumsum((0, *lengths[:-1]))
    for begin in starts:
        u[begin : begin + 10] = 0.0
    parts = [u[begin : begin + length, 0] for begin, length in zip(starts, lengths, strict=True)]
    y = np.concatenate([first_order(part, 2.0, 0.9, 5) for part in parts])
    found = identify_linear(u, y + random.normal(0.0, 0.05, y.size), 1.0, lengths, max_order=2)
    assert (found.order, found.delays[0][0]) == (1, 5)


def test_orders_begin_with_the_best_one():
    random = np.random.default_rng(9)
    u = steps(random, 300)
    y = first_order(u[:, 0], 2.0, 0.9, 3) + random.normal(0.0, 0.05, 300)
    best, *others = identify_orders(u, y, max_order=3)
    assert best.candidates == identify_linear(u, y, max_order=3).candidates
    compared = {each.order for each in best.candidates if each.order <= best.order + 2}
    assert sorted([best.order, *(each.order for each in others)]) == sorted(compared)


@pytest.mark.parametrize(
    ("u", "y", "text"),
    [
        (np.zeros(20), np.zeros(19), "equal lengths"),
        (np.zeros(20), np.full(20, np.nan), "missing values"),
        (np.zeros(5), np.zeros(5), "at least 10 samples"),
    ],
)
def test_unusable_records_are_refused(u, y, text):
    with pytest.raises(RecordError, match=text):
        identify_linear(u, y)
