"""Block of the signals as measured: the offsets of the preprocessing are in the equations."""

from dataclasses import replace

from islands.errors import ModelError
from islands.models.block import Block, subtract_offsets
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import Model, measured_model, start_at_offsets
from islands.models.protocol import DynamicModel
from islands.models.signal_statement import describe_signals


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
            return start_at_offsets(measured_model(model).block(), model, range(1 + model.inputs))
        case CoupledModel():
            return model.measured_block()
    block = model.block()
    found = subtract_offsets(block, model.preprocessing)
    # The text of the equations is in deviations, so that it states which.
    return (
        block if found is block else replace(found, texts=(*block.texts, f"where {describe_signals(model)}"))
    )


def program_block(model: DynamicModel | CoupledModel) -> Block:
    """Return the block of an exported program: that of the measured signals, without late inputs.

    Raises
    ------
    ModelError
        The model has no parameters.
    """
    return measured_block(model).expand_delays()
