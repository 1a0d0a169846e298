"""Blocks of a record and the error on held-out rows."""

import numpy as np
import pytest

from islands.estimation.fitted_state_space import Draft
from islands.estimation.latent_data import SignalScales, make_latent_data, measure_held_out
from islands.models.latent import StateSpaceLayout
from islands.records.dataset import Dataset, join
from islands.simulation.initial_states import Segment, simulate_errors
from support.latent_systems import spring_record


def whole_blocks(data):
    """Return the blocks with all rows, whose outputs are missing before the held-out ones."""
    return data.held_out.runs[: len(data.used)]


@pytest.mark.parametrize("samples", [240, 3000, 30_000])
def test_every_row_is_in_one_block(samples):
    data = make_latent_data(spring_record(samples))
    # The first sample lacks its input.
    assert sum(len(block.y) for block in whole_blocks(data)) == samples - 1
    assert max(len(block.y) for block in data.used) <= 600
    assert max(len(block.y) for block in data.final) <= 6000
    for used, final, whole in zip(data.used, data.final, whole_blocks(data), strict=True):
        cut = len(used.y)
        assert cut <= 0.8 * len(whole.y) + 1
        assert np.array_equal(used.y, final.y[:cut])
        assert np.array_equal(final.u, whole.u[: len(final.u)])
        assert np.isnan(whole.y[:cut]).all()
        assert np.array_equal(final.y[cut:], whole.y[cut : len(final.y)])


def test_blocks_do_not_cross_segments():
    data = make_latent_data(join([spring_record(700), spring_record(300, seed=3)]))
    assert [len(block.y) for block in whole_blocks(data)] == [699, 299]


def fit_bistable(weight, data):
    """Return a fit of a state with the gain 0.5 + 1.2 weight at zero: above 1 it has two equilibria."""
    layout = StateSpaceLayout(1, 1, 1)
    theta = np.zeros(len(layout.names))
    values = {"a1_1": 0.5, "b1": 0.01, "c1": 1.0, "e1_1": 1.2, "w1_1": weight}
    for name, value in values.items():
        theta[layout.names.index(name)] = value
    free = theta != 0.0
    return Draft(layout, ("tanh",), theta, free, np.zeros((len(data.used), 1))).begin(data.used)


@pytest.mark.ci
def test_a_second_equilibrium_has_a_large_error():
    u = np.random.default_rng(0).standard_normal(1000)
    data = make_latent_data(Dataset(u, u, 1.0))
    one, two = (measure_held_out(fit_bistable(weight, data), data) for weight in (0.2, 1.0))
    assert one < 1.5 * np.var(u)
    assert two > 3.0 * np.var(u)


def fit_spring(cubic, data, gain):
    """Return a fit of a state whose gain grows with the square of the state."""
    layout = StateSpaceLayout(1, 1, 1)
    theta = np.zeros(len(layout.names))
    for name, value in {"a1_1": 0.5, "b1": gain, "c1": 1.0, "e1_1": cubic, "w1_1": 1.0}.items():
        theta[layout.names.index(name)] = value
    return Draft(layout, ("cube",), theta, theta != 0.0, np.zeros((len(data.used), 1))).begin(data.used)


def test_a_system_that_diverges_at_larger_inputs_has_a_model():
    """A check beyond the data excludes no model that the data confirm: the system fails it, too."""
    # x = 0.5 x + 0.2 u + e x^3 has no equilibrium from u = (2/3) (0.5/(3 e))^0.5 0.5/0.2 on.
    assert 1.0 < (2.0 / 3.0) * np.sqrt(0.5 / (3.0 * 0.35)) * 2.5 < 1.2
    u, y = np.sign(np.sin(0.05 * np.arange(1000))), np.zeros(1001)
    for k in range(1000):
        y[k + 1] = 0.5 * y[k] + 0.2 * u[k] + 0.35 * y[k] ** 3
    data = make_latent_data(Dataset(u, y[:1000], 1.0, ("u",)), "odd")
    height = data.scales.height
    fit = fit_spring(0.35 * height**2, data, 0.2 * data.scales.deviation[0] / height)
    assert measure_held_out(fit, data) < 1e-6 * height**2


def test_parameters_in_the_units_of_the_record_give_its_signals():
    record = spring_record(300)
    scales = SignalScales.measure(record)
    layout, rng = StateSpaceLayout(2, 1, 1), np.random.default_rng(4)
    theta = 0.3 * rng.standard_normal(len(layout.names))
    codes, start = np.array([0]), rng.standard_normal(2)
    scaled = Segment(scales.scale_inputs(record.u), scales.scale_outputs(record.y))
    errors = simulate_errors(theta, codes, scaled, start)
    measured = scales.use_record_units(layout, theta)
    found = simulate_errors(measured, codes, Segment(record.u, record.y), start)
    assert found == pytest.approx(scales.height * errors)
    assert scales.use_scaled_units(layout, measured) == pytest.approx(theta)


def test_a_dead_time_moves_the_inputs_within_their_recording():
    data = make_latent_data(join([spring_record(700), spring_record(300, seed=3)]))
    late = data.delay((4,))
    for block, same in zip(late.used, data.used, strict=True):
        assert np.array_equal(block.y, same.y)
        assert np.array_equal(block.u[4:], same.u[:-4])
        assert np.all(block.u[:4] == same.u[0])
    assert data.delay((0,)) is data


def test_many_recordings_are_used_in_part():
    data = make_latent_data(join([spring_record(1600, seed=seed) for seed in range(20)]))
    assert len(data.used) == 10
    assert sum(len(block.y) for block in data.used) <= 6_000
    # The blocks are from the whole record, with the first and the last recording.
    assert np.array_equal(data.held_out.late[0].y, data.scaled.y[600:1600])
    assert np.array_equal(data.held_out.late[-1].y, data.scaled.y[-1000:])
