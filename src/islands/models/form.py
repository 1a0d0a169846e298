"""Form of a model: what its output depends on."""

from islands.expressions.tree import Constant, Lagged
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.records.channel_names import parse_channel_name


def is_linear(model: AnyModel) -> bool:
    """Return whether the next output of a model is linear in its inputs and its states."""
    if isinstance(model, CoupledModel):
        return all(map(is_linear, model.models))
    if isinstance(model, LatentModel):
        return not model.units
    return isinstance(model, Model) and all(
        isinstance(item.expression, Lagged | Constant) for item in model.regressors
    )


def is_static(model: AnyModel) -> bool:
    """Return whether the output of a model depends on the inputs of the same sample only, and on one."""
    if isinstance(model, CoupledModel):
        return all(map(is_static, model.models))
    if isinstance(model, LatentModel):
        return not model.order and not any(model.delays) and reads_inputs(model)
    if not isinstance(model, Model):
        return False
    now = {(place, 1) for place, name in enumerate(model.input_names, 1) if parse_channel_name(name).at_once}
    lags = {each for item in model.regressors for each in item.lags}
    return bool(lags) and lags <= now


def name_form(model: AnyModel) -> str:
    """Return the form of a model.

    It is ``static``, ``linear``, ``curve`` (linear with one), ``equation`` or ``state space``.
    """
    if is_static(model):
        return "static"
    if is_linear(model):
        return "linear"
    if isinstance(model, LatentModel):
        return "curve" if len(model.units) == 1 else "state space"
    return "equation"


def reads_inputs(model: AnyModel) -> bool:
    """Return whether the output of a model depends on an input."""
    if isinstance(model, CoupledModel):
        return any(map(reads_inputs, model.models))
    if isinstance(model, LatentModel):
        blocks = model.layout.split(model.theta)
        return any(block.any() for block in (blocks["B"], blocks["D"], blocks["W"][:, model.order :]))
    return isinstance(model, Model) and any(channel for item in model.regressors for channel, _ in item.lags)
