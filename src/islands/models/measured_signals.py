"""Block of the signals as measured: the offsets of the preprocessing are in the equations."""

from collections.abc import Iterable
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
            return _start_at_offsets(measured_model(model).block(), model, range(1 + model.inputs))
        case CoupledLatentModel():
            return model.measured_block()
        case CoupledModel():
            block = measured_coupled_model(model).block()
            return _start_at_offsets(block, model.models[0], model.channels(0))
    block = model.block()
    found = subtract_offsets(block, model.preprocessing)
    # The text of the equations is in deviations, so that it states which.
    return (
        block if found is block else replace(found, texts=(*block.texts, f"where {describe_signals(model)}"))
    )


def _start_at_offsets(block: Block, model: DynamicModel, channels: Iterable[int]) -> Block:
    """Return a block whose past signals are the offsets of a model unless others are given."""
    done = model.preprocessing
    if done is None:
        return block
    offsets = zip(channels, (done.output_offset, *done.input_offsets), strict=True)
    return replace(block, levels={block.signals[channel]: offset for channel, offset in offsets})
