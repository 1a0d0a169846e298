"""Models of one and of several outputs, and the signals of their blocks."""

from dataclasses import dataclass, replace

import numpy as np

from islands.data.coupled_record import CoupledRecord
from islands.data.dataset import Dataset
from islands.models.block import Block
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel
from islands.models.measured_signals import measured_block
from islands.models.narx import Model
from islands.simulation.blocks import make_block_simulator
from islands.simulation.predictors import free_run
from support.coupled_systems import PREY, TWO_MASSES, make_coupled_record
from support.gain_scheduled import TRUE, GainScheduledModel, make_record
from support.latent_systems import make_coupled_latent_model, smooth_input
from support.programs import CASES, model, record, record_of

#: Chosen for their states: past inputs and outputs, several inputs, no past, an input that acts at once.
OF_STATES = {
    **{
        name: replace(CASES[name], dt=CASES[name].dt or 0.1)
        for name in (
            "published 12",
            "many parts",
            "several inputs",
            "a constant, that needs no past",
            "no output",
            "tanh",
        )
    },
    "at once": replace(model({"y(k-1)": 0.5, "u1(k-1)*u2(k-2)": 0.25}, ("a_V+1", "b_A")), dt=0.1),
}

#: Models of several outputs, and of a state that is not measured, as well.
OF_BLOCKS = {
    **OF_STATES,
    "two masses": TWO_MASSES,
    "prey": PREY,
    "state spaces": make_coupled_latent_model(),
    "not measured": GainScheduledModel.of_record(make_record(), TRUE),
}


@dataclass(frozen=True)
class BlockCase:
    """A model and the signals of its block.

    Attributes
    ----------
    exported : Model or CoupledModel
    block : Block
    past : list of float
        Samples before the first one, in the order of the state.
    inputs : ndarray, shape (samples, inputs)
    outputs : ndarray, shape (samples, outputs)
    """

    exported: Model | CoupledModel
    block: Block
    past: list[float]
    inputs: np.ndarray
    outputs: np.ndarray


def block_case(name):
    """Return a case of ``OF_BLOCKS``."""
    exported = OF_BLOCKS[name]
    if isinstance(exported, CoupledLatentModel):
        return rest_case(exported)
    if isinstance(exported, CoupledModel):
        return coupled_case(exported, make_coupled_record(exported, samples=60))
    if isinstance(exported, GainScheduledModel):
        return state_case(exported, make_record(samples=60))
    return model_case(exported, record(exported.inputs, dt=0.1) if name == "at once" else record_of(name))


def rest_case(exported):
    """Return the case of latent models of several outputs that start at rest."""
    block, first, u = measured_block(exported), exported.maximum_lag, smooth_input(60, 3)
    data = CoupledRecord(
        tuple(Dataset(u, np.zeros(60), 0.01, ("u_V",), name) for name in exported.output_names)
    )
    simulated = make_block_simulator(block, data, None, first)(np.array([exported.parameters]))[0].T
    start = np.tile(
        [*(0.0 for _ in exported.models), *block.start_values()[block.outputs :]][: block.computed],
        (first, 1),
    )
    return make_case(exported, data.u, np.concatenate([start, simulated[first:]]), simulated)


def model_case(exported, data):
    """Return the case of a model and a record at its rate, as measured."""
    simulated = free_run(exported, data)
    assert simulated.outcome
    return make_case(exported, data.u, data.y[:, None], simulated.y[:, None])


def state_case(exported, data):
    """Return the case of a model with states, which are outputs of its block."""
    block, first = measured_block(exported), exported.maximum_lag
    simulated = make_block_simulator(block, data, None, first)(np.array([exported.parameters]))[0].T
    start = np.array([data.y[:first], *(data.y[:first] - TRUE[-1] for _ in block.starts)]).T
    return make_case(exported, data.u, np.concatenate([start, simulated[first:]]), simulated)


def coupled_case(exported, data):
    """Return the case of a model of several outputs and a record at its rate, as measured."""
    simulated = free_run(exported, data)
    assert simulated.outcome
    return make_case(exported, data.records[0].u, data.y, simulated.y)


def make_case(exported, u, y, simulated):
    """Return the case of a simulation, of shape (samples, outputs), that starts from measured samples."""
    block, first = measured_block(exported), max(exported.maximum_lag, 1)
    signals = [*y.T, *u.T]
    past = [float(signals[channel][first - lag]) for channel, lag in block.samples]
    return BlockCase(exported, block, past, np.ascontiguousarray(u[first:]), simulated[first:])
