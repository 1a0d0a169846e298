"""Simulations from inputs alone, of models of every class."""

import numpy as np
import pytest

import islands
from islands.models.linearisation import linearise_block
from islands.models.measured_signals import measured_block
from islands.simulation.predictors import free_run
from islands.simulation.stepper import Stepper
from support.block_cases import OF_BLOCKS, mark_slow

#: Models with an equilibrium at the inputs of their start.
RESTING = [name for name in OF_BLOCKS if name not in ("published 12", "three outputs", "integrator")]

STATE_SPACES = [name for name in RESTING if measured_block(OF_BLOCKS[name]).is_state_space]


def start(name):
    """The inputs at which a program of a model starts."""
    block = measured_block(OF_BLOCKS[name])
    return [block.levels.get(each, 0.0) for each in block.signals[block.computed :]]


def make_inputs(name, samples=40):
    level = np.array(start(name))
    return level + np.random.default_rng(1).uniform(-0.3, 0.3, (samples, len(level)))


@pytest.mark.parametrize("name", mark_slow(OF_BLOCKS))
def test_steps_have_the_bits_of_one_simulation(name):
    model, u = OF_BLOCKS[name], make_inputs(name)
    block = measured_block(model)
    y = None if name in RESTING else np.full(block.outputs, 0.1)
    at_once = Stepper(model, u[0], y).run(u)
    stepper = Stepper(model, u[0], y)
    one_by_one = np.array([np.atleast_1d(stepper.step(each)) for each in u])
    assert one_by_one.tobytes() == at_once.tobytes()


@pytest.mark.parametrize("name", mark_slow(RESTING))
def test_a_simulation_from_rest_at_constant_inputs_stays_there(name):
    model, u = OF_BLOCKS[name], np.tile(start(name), (200, 1))
    y = Stepper(model, u[0]).run(u)
    assert y == pytest.approx(np.tile(y[0], (200, 1)), rel=1e-9, abs=1e-9)
    assert y[0] == pytest.approx(linearise_block(measured_block(model), u[0]).operating_outputs, abs=1e-9)


@pytest.mark.parametrize("name", ["published 12", "many parts", "deviations", "means"])
def test_a_simulation_from_an_output_has_the_bits_of_the_free_run_of_a_record_with_it(name):
    model, u, y0 = OF_BLOCKS[name], make_inputs(name), 0.2
    lag = model.maximum_lag
    record = islands.Dataset(
        np.vstack([np.tile(u[0], (lag, 1)), u]),
        np.append(np.full(lag, y0), np.full(len(u), np.nan)),
        model.dt,
        model.column_names,
        model.output_name,
        preprocessing=model.preprocessing and model.preprocessing.without_offsets,
    )
    assert Stepper(model, u[0], y0).run(u)[:, 0].tobytes() == free_run(model, record).y[lag:].tobytes()


@pytest.mark.parametrize("name", STATE_SPACES)
def test_the_states_at_a_sample_continue_its_simulation(name):
    model, u = OF_BLOCKS[name], make_inputs(name)
    whole, stepper = Stepper(model, u[0]).run(u), Stepper(model, u[0])
    stepper.run(u[:8])
    again = Stepper(model, u[7], states=stepper.states)
    assert again.run(u[7:]) == pytest.approx(whole[7:], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", STATE_SPACES)
def test_corrected_states_are_those_of_the_next_steps(name):
    model, u = OF_BLOCKS[name], make_inputs(name)
    first, second = Stepper(model, u[0]), Stepper(model, u[0])
    first.run(u[:8])
    second.run(u[3:8])
    second.states = first.states
    assert second.run(u[8:]).tobytes() == first.run(u[8:]).tobytes()


@pytest.mark.parametrize("name", STATE_SPACES)
def test_a_state_space_starts_near_an_output_that_it_can_have(name):
    model, u = OF_BLOCKS[name], np.tile(start(name), (30, 1))
    at_rest = Stepper(model, u[0]).run(u)
    assert Stepper(model, u[0], at_rest[0]).run(u) == pytest.approx(at_rest, abs=1e-6)


def test_what_is_given_is_checked():
    narx, latent = OF_BLOCKS["many parts"], OF_BLOCKS["state space"]
    with pytest.raises(islands.ModelError, match="states are those of a state space"):
        Stepper(narx, 0.0, states=[0.0])
    with pytest.raises(islands.SettingsError, match="has 2 states: give as many numbers"):
        Stepper(latent, 0.0, states=[0.0])
    with pytest.raises(islands.SettingsError, match="inputs are finite"):
        Stepper(latent, 0.0).step(np.nan)


def test_of_several_rests_that_within_the_range_of_the_output_is_the_start():
    model = islands.make_model(
        [(islands.parse("y(k-1)"), 1.1), (islands.parse("y(k-1)^3"), -0.1), (islands.parse("u(k-1)"), 0.1)]
    )
    with pytest.raises(islands.ModelError, match="several stable equilibria"):
        Stepper(model, u=0.0)
    for rest in (-1.0, 1.0):
        stepper = Stepper(model, u=0.0, within=(rest - 0.5, rest + 0.5))
        assert stepper.step(0.0) == pytest.approx(rest)
