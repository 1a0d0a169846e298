"""`linearise`: a model about an operating point as a linear system, with its uncertainty."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

from numpy.typing import ArrayLike

from islands.errors import ModelError
from islands.models.coupled_narx import AnyModel, CoupledModel, list_models
from islands.models.latent import LatentModel
from islands.models.linearisation import OperatingPoint, find_rest, read_levels
from islands.models.measured_signals import measured_block
from islands.models.parametric import ParametricModel
from islands.models.protocol import DynamicModel, no_model_error
from islands.models.state_space import StateSpace
from islands.validation.ensemble import Ensemble


def linearise(
    model: AnyModel,
    operating_point: OperatingPoint | None = None,
    y: ArrayLike | None = None,
    ensemble: Ensemble | None = None,
) -> StateSpace:
    """Linearise a model about an operating point.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model with parameters.
    operating_point : float, sequence of float or mapping, optional
        Constant value of every input as measured, in the order of the model or by column; by default, and for
        columns that a mapping leaves out, the point at which an exported program of the model starts.
    y : float or sequence of float, optional
        Outputs there; by default the stable equilibrium.
    ensemble : Ensemble, optional
        Models that the data do not exclude, whose linearisations become the members of the system.

    Returns
    -------
    StateSpace
        System of the deviations from the operating point, with the names and units of the columns and the
        sampling time of the model.

    Raises
    ------
    ModelError
        The model has no unique stable equilibrium at these inputs and no output is given, or it has a kink or
        a step at the operating point.
    """
    if not isinstance(model, DynamicModel | CoupledModel):
        raise no_model_error(model)
    system = model.linearise(operating_point, y)
    members, weights = [], []
    for each in ensemble.structures if ensemble else ():
        for parameters in each.parameters.tolist():
            # The states of a member may have no rest there.
            with suppress(ModelError):
                member = each.model.with_parameters(parameters)
                outputs = None if _has_own_outputs(member) else system.operating_outputs
                members.append(member.linearise(system.operating_inputs, outputs))
                weights.append(each.weight / len(each.parameters))
    kept = tuple(weight / sum(weights) for weight in weights)
    return replace(system, members=tuple(members), weights=kept)


def _has_own_outputs(model: AnyModel) -> bool:
    """Return whether states determine the outputs of a model."""
    (single, *_) = list_models(model)
    return isinstance(single, LatentModel) or (isinstance(single, ParametricModel) and bool(single.states))


def find_rest_of_data(
    model: DynamicModel, operating_point: OperatingPoint, within: tuple[float, float]
) -> list[float] | None:
    """Return the output at rest within the range of the data, which other equilibria leave; None without."""
    block = measured_block(model)
    with suppress(ModelError):
        return find_rest(block, read_levels(block, operating_point), within)
    return None


def split_point(
    model: AnyModel, levels: Mapping[str, float]
) -> tuple[dict[str, float] | None, list[float] | None]:
    """Return the inputs and the outputs of an operating point by column; None for those not given.

    Raises
    ------
    ModelError
        Some outputs are given, but not all.
    """
    outputs = [each.output_name for each in list_models(model)]
    inputs = {name: level for name, level in levels.items() if name not in outputs}
    given = [name for name in outputs if name in levels]
    if given and len(given) < len(outputs):
        raise ModelError(
            f"the model has the outputs {', '.join(outputs)}: give the level of each, or of none"
        )
    return inputs or None, [levels[name] for name in given] or None
