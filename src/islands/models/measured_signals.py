"""Block of the signals as measured: the offsets of the preprocessing are in the equations."""

from islands.errors import ModelError
from islands.models.block import Block, subtract_offsets
from islands.models.coupled_narx import CoupledModel, measured_coupled_model
from islands.models.narx import Model, measured_model
from islands.models.protocol import DynamicModel


def measured_block(model: DynamicModel | CoupledModel) -> Block:
    """Return the block of a model of the measured signals, with the offsets in its equations.

    Raises
    ------
    ModelError
        The model has no parameters.
    """
    if not model.parameters:
        raise ModelError("the model has no parameters, so that there is nothing to export")
    match model:
        case Model():
            return measured_model(model).block()
        case CoupledModel():
            return measured_coupled_model(model).block()
    return subtract_offsets(model.block(), model.preprocessing)
