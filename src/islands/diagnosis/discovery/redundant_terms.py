"""Redundant candidate terms: those that the calibrated parameters of their equation reproduce.

A gain of the input is redundant in the equation of an oscillator whose mass, damping and stiffness are free.
Its gain would be that of a calibration which continues.
"""

from collections.abc import Sequence, Set

import numpy as np

from islands.diagnosis.discovery.candidate_terms import CandidateTerm
from islands.effects.interface.context import Signal
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.expressions.tree import Expression, find_symbols, substitute
from islands.simulators.ode.equation_parser import FORCE
from islands.simulators.ode.system import OUTPUT, OdeSystem, sort_variables

#: Number of random values of the signals at which an equation and a term are compared.
_POINTS = 200

#: Relative change of a parameter for the derivative of an equation.
_STEP = 1e-5

#: Part of the sum of squares of a term below which the parameters reproduce it.
_REPRODUCED = 1e-8


class _RandomSignals(dict[str, Signal]):
    """Random values of each signal that an equation reads."""

    def __init__(self) -> None:
        super().__init__({FORCE: np.zeros(_POINTS)})
        self._rng = np.random.default_rng(0)

    def __missing__(self, name: str) -> Signal:
        self[name] = self._rng.standard_normal(_POINTS)
        return self[name]


def drop_redundant_terms(
    candidates: Sequence[CandidateTerm], system: OdeSystem, fixed: Set[str] = frozenset()
) -> list[CandidateTerm]:
    """Return the candidates that the free parameters of their equations do not reproduce.

    Parameters
    ----------
    candidates : sequence of CandidateTerm
    system : OdeSystem
        Equations with the values of a calibration.
    fixed : set of str
        Names of parameters that are not free.
    """
    signals, parameters = _RandomSignals(), {each.name for each in system.parameters}
    right_sides = _substitute_variables(system)
    spans = {target: _span_changes(target, right_sides, system, fixed, signals) for target in right_sides}
    return [
        each
        for each in candidates
        if each.scale is not None
        # A law of the equation itself: random signals may not change the sign of its rate.
        or not parameters.isdisjoint(find_symbols(parse_expression(each.text)))
        or not _is_in_span(evaluate(parse_expression(each.text), signals), spans[each.target])
    ]


def _substitute_variables(system: OdeSystem) -> dict[str, Expression]:
    """Return the right-hand sides of all states and of the output, without intermediate variables."""
    variables: dict[str, Expression] = {}
    given = dict(system.variables)
    for name in sort_variables(system):
        if name in given:
            variables[name] = substitute(given[name], variables)
    equations = {**dict(system.derivatives), OUTPUT: system.output}
    return {name: substitute(right, variables) for name, right in equations.items()}


def _span_changes(
    target: str,
    right_sides: dict[str, Expression],
    system: OdeSystem,
    fixed: Set[str],
    signals: _RandomSignals,
) -> Signal:
    """Return the derivatives of an equation by the free parameters of no other one, (points, parameters)."""
    others = {name for other, right in right_sides.items() if other != target for name in find_symbols(right)}
    own = set(find_symbols(right_sides[target])) - others - fixed
    columns = []
    for parameter in system.parameters:
        if parameter.name in own and not parameter.fixed:
            step = _STEP * (abs(parameter.value) or 1.0)
            moved = []
            for value in (parameter.value - step, parameter.value + step):
                values = {each.name: each.value for each in system.parameters} | {parameter.name: value}
                signals.update({name: np.full(_POINTS, number) for name, number in values.items()})
                moved.append(evaluate(right_sides[target], signals))
            columns.append((moved[1] - moved[0]) / (2.0 * step))
    found: Signal = np.column_stack(columns) if columns else np.empty((_POINTS, 0))
    return found


def _is_in_span(values: Signal, columns: Signal) -> bool:
    """Return whether a combination of the columns is equal to the values, where all are finite."""
    finite = np.isfinite(values) & np.isfinite(columns).all(axis=1)
    if columns.shape[1] == 0 or finite.sum() <= 2 * columns.shape[1]:
        return False
    scales = np.linalg.norm(columns[finite], axis=0)
    used = columns[finite][:, scales > 0.0] / scales[scales > 0.0]
    rest = values[finite] - used @ np.linalg.lstsq(used, values[finite], rcond=None)[0]
    return bool(rest @ rest <= _REPRODUCED * (values[finite] @ values[finite]))
