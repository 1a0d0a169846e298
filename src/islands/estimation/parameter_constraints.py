"""Table of parameter constraints that hold exactly for any data, and the statements of users.

A constraint has the form ``S theta = c``, restricts the regressors of a model, or fixes the sign of a
parameter. Statements are combined with semicolons: ``odd; gain = 2.5``.
"""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from islands.errors import SettingsError
from islands.estimation.constraints.conditions import Constrained, Constraint
from islands.estimation.constraints.parser import parse_statements
from islands.estimation.constraints.parts import ClusterSums, FixedPoint, StaticGain, Symmetry
from islands.expressions.tree import Expression
from islands.models.clusters import OUTPUT_AT_REST, steady_state
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.simulation.outcome import EvaluationOutcome, Status

#: Property 1 (the paper, section 3): with these sums every output is an equilibrium at constant input.
PROPERTY_1: Mapping[Expression, float] = MappingProxyType({OUTPUT_AT_REST: 1.0})

CONSTRAINTS: Mapping[str, Constraint] = MappingProxyType(
    {
        "none": Constraint((), "parameters are free"),
        "hysteresis": Constraint(
            (ClusterSums("hysteresis", steady_state, PROPERTY_1, "no regressor is y at rest: add y(k-1)"),),
            "a continuum of equilibria (Property 1)",
        ),
        "odd": Constraint((Symmetry("odd", -1),), "reversing the inputs reverses the output"),
        "even": Constraint((Symmetry("even", 1),), "reversing the inputs leaves the output as it is"),
    }
)


@lru_cache(maxsize=256)
def constraint(text: str) -> Constraint:
    """Return a constraint: an entry of `CONSTRAINTS`, or statements that are separated by semicolons.

    Raises
    ------
    SettingsError
        A statement cannot be read, or two statements exclude each other.
    """
    if text in CONSTRAINTS:
        return CONSTRAINTS[text]
    parts = parse_statements(text, {name: entry.parts for name, entry in CONSTRAINTS.items()})
    parts = tuple({part.text: part for part in parts}.values())
    kinds = {type(part) for part in parts}
    if {ClusterSums, StaticGain} <= kinds:
        raise SettingsError("a model with hysteresis has no static gain: every output is an equilibrium")
    return Constraint(parts)


def check_latent_constraints(constraints: str) -> None:
    """Check that statements are about latent models.

    Raises
    ------
    SettingsError
        A statement cannot be read, or makes no sense for a latent model.
    """
    for part in constraint(constraints).parts:
        match part:
            case FixedPoint() | StaticGain() | Symmetry(parity=-1):
                continue
            case ClusterSums():
                reason = (
                    "its states would have to stay where the units leave them, which needs a pole of exactly "
                    "1 that no input moves; take the preset hysteresis"
                )
            case Symmetry():
                reason = "its states read the inputs linearly, which is odd"
            case _:
                reason = (
                    "it has no terms, and the parameters of a state space are not unique: other coordinates "
                    "of the states change them without an effect on the output"
                )
        raise SettingsError(
            f"the constraint {part.text!r} is none of a latent model: {reason}. "
            "Statements about latent models are gain, fixed-point and odd"
        )


def constrain_model(model: AnyModel, text: str) -> Constrained | EvaluationOutcome:
    """Return the constraint on the parameters of a model, which holds for each of its equations.

    Returns
    -------
    Constrained or EvaluationOutcome
        INFEASIBLE if the structure cannot meet the constraint, or if a parameter is forced to zero.

    Raises
    ------
    SettingsError
        A statement cannot be read, or the model is not a NARX model, whose terms the statements are about.
    """
    if isinstance(model, CoupledModel):
        return _constrain_equations(model, text)
    if not isinstance(model, Model):
        if text != "none":
            raise SettingsError(f"the constraints {text!r} are about the terms of a NARX model: take 'none'")
        return Constrained((), np.empty((0, model.size)), np.empty(0), np.zeros(model.size))
    constrained = constraint(text).constrain(model.regressors)
    if not isinstance(constrained, EvaluationOutcome) and constrained.regressors != model.regressors:
        return EvaluationOutcome(
            Status.INFEASIBLE, "the constraint forces a parameter to zero: remove its term"
        )
    return constrained


def _constrain_equations(model: CoupledModel, text: str) -> Constrained | EvaluationOutcome:
    parts = []
    for single in model.models:
        part = constrain_model(single, text)
        if isinstance(part, EvaluationOutcome):
            return part
        parts.append(part)
    matrix = np.zeros(np.sum([part.S.shape for part in parts], axis=0))
    row = column = 0
    for part in parts:
        rows, columns = part.S.shape
        matrix[row : row + rows, column : column + columns] = part.S
        row, column = row + rows, column + columns
    return Constrained(
        tuple(item for part in parts for item in part.regressors),
        matrix,
        np.concatenate([part.c for part in parts]),
        np.concatenate([part.signs for part in parts]),
    )


def count_free_parameters(model: DynamicModel, text: str) -> int:
    """Return the number of parameters that remain free: the dimension of the null space.

    A structure that cannot meet the constraint was not estimated under it; all of its parameters count.
    """
    if not isinstance(model, Model):
        return model.size
    constrained = constraint(text).constrain(model.regressors)
    if isinstance(constrained, EvaluationOutcome):
        return model.size
    return len(constrained.regressors) - len(constrained.c)
