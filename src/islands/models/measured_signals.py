"""Block of the signals as measured: the offsets of the preprocessing are in the equations."""

from dataclasses import replace

from islands.errors import ModelError
from islands.models.block import Block, subtract_offsets
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel, measured_coupled_model
from islands.models.narx import Model, measured_model
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
            return measured_model(model).block()
        case CoupledLatentModel():
            return model.measured_block()
        case CoupledModel():
            return measured_coupled_model(model).block()
    block = model.block()
    found = subtract_offsets(block, model.preprocessing)
    # The text of the equations is in deviations, so that it states which.
    return (
        block if found is block else replace(found, texts=(*block.texts, f"where {describe_signals(model)}"))
    )
