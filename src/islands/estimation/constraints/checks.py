"""Verification of constraints on a model with parameters."""

from dataclasses import dataclass
from math import fsum, nan

import numpy as np

from islands.estimation.constraints.parts import (
    ClusterSums,
    Equality,
    FixedPoint,
    ParameterSign,
    Part,
    StaticGain,
    Symmetry,
)
from islands.estimation.constraints.state_space import take_system
from islands.estimation.constraints.static_state import find_static_state
from islands.estimation.parameter_constraints import check_latent_constraints, constrain_model, constraint
from islands.models.clusters import clusters
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.models.unit_functions import parse_unit
from islands.rounding import ROUNDING


@dataclass(frozen=True, slots=True)
class ConstraintCheck:
    """A constraint, and whether a model meets it.

    Attributes
    ----------
    text : str
    target : float
        Value that the constraint prescribes, or the bound of a parameter with a sign.
    value : float
        Value of the model: the static gain, the next output at the fixed point, the weighted sum or the
        parameter. For cluster sums, the largest deviation from a target. For a symmetry, the number of terms
        without it, of a latent model of parameters, units and limits. NaN if it is not defined.
    met : bool
    """

    text: str
    target: float
    value: float
    met: bool


def check_constraints(model: DynamicModel, constraints: str) -> tuple[ConstraintCheck, ...]:
    """Check every part of a constraint on a model.

    Parameters
    ----------
    model : DynamicModel
    constraints : str
        Statements that are separated by semicolons.

    Raises
    ------
    ModelError
        The model has no parameters.
    SettingsError
        A statement cannot be read, or makes no sense for the class of the model.
    """
    if isinstance(model, LatentModel):
        return _check_latent(model, constraints)
    if not isinstance(model, Model):
        constrain_model(model, constraints)
        return ()
    return tuple(_check(part, model) for part in constraint(constraints).parts)


def _check(part: Part, model: Model) -> ConstraintCheck:
    match part:
        case ClusterSums():
            return _check_sums(part, model)
        case Symmetry():
            others = sum(not part.admits(item) for item in model.regressors)
            return ConstraintCheck(part.text, 0.0, float(others), not others)
        case ParameterSign():
            parameters = dict(zip(model.regressors, model.parameters, strict=True))
            theta = parameters.get(part.regressor, 0.0)
            return ConstraintCheck(part.text, 0.0, theta, part.sign * theta >= 0.0)
    return _check_equality(part, model)


def _check_latent(model: LatentModel, constraints: str) -> tuple[ConstraintCheck, ...]:
    check_latent_constraints(constraints)
    return tuple(
        _check_odd(part, model) if isinstance(part, Symmetry) else _check_static(part, model)
        for part in constraint(constraints).parts
    )


def _check_odd(part: Symmetry, model: LatentModel) -> ConstraintCheck:
    offsets = [name for name in model.names if name[0] in "os" or name == "level"]
    others = len(offsets) + sum(parse_unit(unit).parity != -1 for unit in model.units)
    lower, upper = model.limits.range
    others += lower != -upper
    return ConstraintCheck(part.text, 0.0, float(others), not others)


def _check_static(part: Part, model: LatentModel) -> ConstraintCheck:
    """Check the output at rest, or its slope, which is that of the linear system there."""
    assert isinstance(part, FixedPoint | StaticGain)
    near, inputs = (part.point[0], part.point[1:]) if part.point else (None, (0.0,) * model.inputs)
    rest = find_static_state(take_system(model), np.array(inputs), near)
    if rest is None:
        return ConstraintCheck(part.text, part.target, nan, met=False)
    (total, largest), (lower, upper) = rest.output, model.limits.range
    value = min(max(total, lower), upper)
    if isinstance(part, StaticGain):
        slope, largest = rest.measure_slope(part.channel)
        # An output at a limit of the sensor does not follow the input.
        value = slope if lower < total < upper else 0.0
    met = abs(value - part.target) <= ROUNDING * max(largest, abs(part.target))
    return ConstraintCheck(part.text, part.target, value, met)


def _check_sums(part: ClusterSums, model: Model) -> ConstraintCheck:
    groups = clusters(model.regressors, part.group)
    complete = part.sums.keys() <= {group.steady_state for group in groups}
    deviations = [group.total(model.parameters) - part.sums.get(group.steady_state, 0.0) for group in groups]
    largest = max(map(abs, deviations), default=0.0)
    return ConstraintCheck(part.text, 0.0, largest if complete else nan, complete and largest <= ROUNDING)


def _check_equality(part: Equality, model: Model) -> ConstraintCheck:
    terms = [part.weigh(item) * theta for item, theta in zip(model.regressors, model.parameters, strict=True)]
    total = fsum(terms)
    met = abs(total - part.target) <= ROUNDING * max(map(abs, (part.target, *terms)))
    if not isinstance(part, StaticGain):
        return ConstraintCheck(part.text, part.target, total, met)
    numerator, feedback = (
        [
            theta * part.slope(item, channel)
            for item, theta in zip(model.regressors, model.parameters, strict=True)
        ]
        for channel in (part.channel, 0)
    )
    remainder = 1.0 - fsum(feedback)
    # An integrator, y(k) = y(k-1), satisfies the equality without having a gain.
    defined = abs(remainder) > ROUNDING * max(map(abs, (1.0, *feedback)))
    gain = fsum(numerator) / remainder if defined else nan
    return ConstraintCheck(part.text, part.target, gain, met and defined)
