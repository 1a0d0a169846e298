"""Constraints on latent models: outputs and slopes of the static characteristic, and odd models.

A fixed point or a gain is an equation of the parameters, which Newton corrections meet. A model is odd if all
of its units are, without offsets.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.conditions import Constrained
from islands.estimation.constraints.elimination import eliminate
from islands.estimation.constraints.parts import FixedPoint, StaticGain
from islands.estimation.constraints.static_state import StateSpaceParameters, find_static_state
from islands.estimation.parameter_constraints import check_latent_constraints, constraint
from islands.models.latent import LatentModel

#: Relative error of an equation up to which it is met, and at which corrections and the last ones end.
_LARGEST_ERROR, _CLOSE, _EXACT = 1e-10, 1e-11, 1e-13

#: Newton corrections of the parameters, and halvings of each, at most.
_CORRECTIONS, _HALVINGS = 12, 4

#: Solves the equations of a metric of the free parameters: of shape (free, columns) like its argument.
Invert = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class StaticCondition:
    """A value of the output at rest, or of its slope, at constant inputs.

    Attributes
    ----------
    inputs : tuple of float
        Constant inputs.
    near : float or None
        Output near which the model rests, of several states at rest; None for any.
    channel : int
        0 for the output, or the number of the input of the slope.
    target : float
    """

    inputs: tuple[float, ...]
    near: float | None
    channel: int
    target: float


class StaticErrors(NamedTuple):
    """Errors of static conditions, and their derivatives.

    Attributes
    ----------
    errors, scales : ndarray, shape (conditions,)
        Errors, and magnitudes to which their rounding errors are relative.
    slopes : ndarray, shape (conditions, parameters)
    states : list of ndarray, shape (states,)
        States at rest of each condition.
    """

    errors: NDArray[np.float64]
    scales: NDArray[np.float64]
    slopes: NDArray[np.float64]
    states: list[NDArray[np.float64]]

    def measure(self, scales: NDArray[np.float64] | None = None) -> float:
        """Return the largest relative error, 0 of no conditions; by default relative to its magnitude."""
        by = self.scales if scales is None else scales
        return float(np.abs(self.errors / by).max(initial=0.0))


@dataclass(frozen=True, slots=True)
class StateSpaceConditions:
    """Conditions on the parameters of a state space with static units.

    Attributes
    ----------
    statics : tuple of StaticCondition
    is_odd : bool
        Whether reversed inputs give the reversed output.
    """

    statics: tuple[StaticCondition, ...] = ()
    is_odd: bool = False

    def scale(
        self, mean: NDArray[np.float64], deviation: NDArray[np.float64], level: float, height: float
    ) -> Self:
        """Return the conditions for signals ``(u - mean) / deviation`` and ``(y - level) / height``."""

        def change(each: StaticCondition) -> StaticCondition:
            inputs = (np.array(each.inputs) - mean) / deviation
            near = None if each.near is None else (each.near - level) / height
            if each.channel:
                target = each.target * float(deviation[each.channel - 1]) / height
            else:
                target = (each.target - level) / height
            return replace(each, inputs=tuple(inputs.tolist()), near=near, target=target)

        return replace(self, statics=tuple(map(change, self.statics)))

    # The parameters of a trial step may overflow.
    @np.errstate(over="ignore", invalid="ignore")
    def evaluate(
        self, system: StateSpaceParameters, starts: Sequence[NDArray[np.float64]] | None = None
    ) -> StaticErrors | None:
        """Return the errors of the static conditions and their derivatives.

        Parameters
        ----------
        system : StateSpaceParameters
        starts : sequence of ndarray, optional
            States near those at rest, one for each condition.

        Returns
        -------
        StaticErrors or None
            None if the system does not rest.
        """
        errors, scales = np.zeros(len(self.statics)), np.ones(len(self.statics))
        slopes, states = np.zeros((len(self.statics), system.theta.size)), []
        for row, each in enumerate(self.statics):
            start = None if starts is None else starts[row]
            rest = find_static_state(system, np.array(each.inputs), each.near, start)
            if rest is None:
                return None
            value = rest.measure(each.channel)
            errors[row], scales[row] = value.total - each.target, max(value.largest, abs(each.target)) or 1.0
            slopes[row] = rest.differentiate(each.channel)
            states.append(rest.x)
        finite = np.isfinite(errors).all() and np.isfinite(slopes).all()
        return StaticErrors(errors, scales, slopes, states) if finite else None

    def are_met(self, system: StateSpaceParameters) -> bool:
        """Return whether the parameters meet the static conditions."""
        found = self.evaluate(system)
        return found is not None and found.measure() <= _LARGEST_ERROR

    def correct(
        self,
        system: StateSpaceParameters,
        free: NDArray[np.bool_],
        invert: Invert,
        tolerance: float = _CLOSE,
        starts: Sequence[NDArray[np.float64]] | None = None,
    ) -> tuple[StateSpaceParameters, StaticErrors] | None:
        """Return a system that meets the static conditions, after the smallest corrections in a metric.

        Parameters
        ----------
        system : StateSpaceParameters
        free : ndarray of bool, shape (parameters,)
            Parameters that may change.
        invert : callable
            Metric of the changes.
        tolerance : float
            Relative error at which the corrections end.
        starts : sequence of ndarray, optional
            As of `evaluate`.

        Returns
        -------
        (StateSpaceParameters, StaticErrors) or None
            None if the corrections do not meet the conditions.
        """
        found = self.evaluate(system, starts)
        scales = np.ones(0) if found is None else found.scales
        for _ in range(_CORRECTIONS):
            if found is None or found.measure() <= tolerance:
                break
            slopes = found.slopes[:, free] / scales[:, None]
            across = invert(slopes.T)
            # Equal conditions, or those that every odd model meets, have dependent rows.
            change = across @ np.linalg.lstsq(slopes @ across, found.errors / scales, rcond=_LARGEST_ERROR)[0]
            for halving in range(_HALVINGS):
                theta = system.theta.copy()
                theta[free] -= change / 2.0**halving
                moved = system.with_theta(theta)
                later = self.evaluate(moved, found.states)
                if later is not None and later.measure(scales) < found.measure(scales):
                    break
            else:
                break
            system, found = moved, later
        return (system, found) if found is not None and found.measure() <= _LARGEST_ERROR else None

    def correct_slightly(
        self, system: StateSpaceParameters, tolerance: float = _CLOSE
    ) -> NDArray[np.float64] | None:
        """Return parameters after the smallest relative corrections; those that are zero remain so."""
        free = system.theta != 0.0
        squares = system.theta[free, None] ** 2
        found = self.correct(system, free, lambda columns: squares * columns, tolerance)
        return None if found is None else found[0].theta

    def polish(self, system: StateSpaceParameters) -> NDArray[np.float64]:
        """Return parameters that meet the static conditions up to rounding.

        The parameters as they are if the corrections fail.
        """
        found = self.correct_slightly(system, _EXACT)
        return system.theta if found is None else found


#: Conditions of free parameters.
NO_CONDITIONS = StateSpaceConditions()


@lru_cache(maxsize=256)
def find_conditions(constraints: str, inputs: int) -> StateSpaceConditions:
    """Return the conditions of statements on the parameters of a latent model, in the units of the record.

    Raises
    ------
    SettingsError
        A statement cannot be read, makes no sense for a latent model, or refers to other inputs.
    """
    check_latent_constraints(constraints)
    stated = constraint(constraints)
    stated.check_inputs(inputs)
    statics, is_odd = [], False
    for part in stated.parts:
        match part:
            case FixedPoint():
                output, *constants = part.point
                statics.append(StaticCondition(tuple(constants), output, 0, output))
            case StaticGain(point=()):
                statics.append(StaticCondition((0.0,) * inputs, None, part.channel, part.gain))
            case StaticGain():
                output, *constants = part.point
                statics.append(StaticCondition(tuple(constants), output, part.channel, part.gain))
            case _:
                is_odd = True
    return StateSpaceConditions(tuple(statics), is_odd)


def linearise_constraints(model: LatentModel, constraints: str) -> Constrained:
    """Return the static conditions on a model, linearised about its parameters, which meet them."""
    conditions = find_conditions(constraints, model.inputs)
    found = conditions.evaluate(take_system(model))
    free = np.isin(model.layout.names, model.wiring)
    rows = np.empty((0, model.size)) if found is None else found.slopes[:, free]
    independent = eliminate(rows, np.zeros(len(rows)))
    assert not isinstance(independent, int), "equations with the right-hand side zero are consistent"
    rows = rows[list(independent.rows)]
    return Constrained((), rows, np.einsum("rp,p->r", rows, model.parameters), np.zeros(model.size))


def meet_constraints(
    model: LatentModel, parameters: NDArray[np.float64], constraints: str
) -> NDArray[np.float64]:
    """Return those parameters of a model that meet the static conditions after small corrections.

    Parameters
    ----------
    model : LatentModel
    parameters : ndarray, shape (draws, parameters)
    constraints : str

    Returns
    -------
    ndarray, shape (kept, parameters)
    """
    conditions = find_conditions(constraints, model.inputs)
    if not conditions.statics:
        return parameters
    kept, free = [], np.isin(model.layout.names, model.wiring)
    for each in parameters.tolist():
        found = conditions.correct_slightly(take_system(model.with_parameters(each)))
        if found is not None:
            kept.append(found[free])
    return np.array(kept).reshape(-1, model.size)


def take_system(model: LatentModel) -> StateSpaceParameters:
    """Return the parameters of a model."""
    return StateSpaceParameters(model.layout, model.theta, model.codes)
