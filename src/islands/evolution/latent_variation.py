"""Variation of state spaces with static units: an offspring is a draft, whose parameters are estimated next.

A crossover adds a unit of another system, with the directions of its argument and of its effect written for
the states of the first. A mutation adds, replaces or removes a unit or a state, fixes some parameters at
zero, disturbs the arguments of the units, or continues the estimation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from islands.estimation.fitted_state_space import Draft, FittedStateSpace, NewUnit
from islands.estimation.latent_data import LatentData
from islands.kernels.state_space import simulate_states
from islands.models.unit_functions import (
    ARGUMENT,
    FUNCTIONS,
    PRODUCT,
    UnitFunction,
    find_codes,
    parse_unit,
)

#: Steps of the estimation of an offspring, before them of the effects of a new unit, and of a system that is
#: estimated further.
STEPS, EFFECT_STEPS, FURTHER_STEPS = 8, 5, 24

#: Most states and units of a system.
MOST_STATES, MOST_UNITS = 8, 6

#: Most operations of a unit that is drawn.
MOST_OPERATIONS = 3

#: Probability that a function is replaced by a single one, and not by a larger tree or a part of it.
_ANOTHER_FUNCTION = 0.6

#: Standard deviations of the offset of a new unit, of its first effects, and of a disturbance of arguments.
_OFFSET, _EFFECT, _DISTURBANCE = 0.7, 1e-3, 0.3

#: Part of its effect with which a unit of another system begins.
_INHERITED = 0.5

#: Least and largest pole of a new state, and the coupling with the others.
_POLES, _COUPLING = (0.3, 0.9995), 1e-3

#: Rows of a block on which the states of two systems are compared, at most.
_COMPARED_ROWS = 1_500


def begin_system(linear: FittedStateSpace, units: Sequence[str], structure: str, rng: Generator) -> Draft:
    """Return a draft of a linear system with units, which have random arguments and negligible effects."""
    drawn = [_draw_unit(linear, unit, rng) for unit in units]
    return _append_units(linear.draft(), drawn).restrict(structure)


def cross(
    system: FittedStateSpace, other: FittedStateSpace, data: LatentData, structure: str, rng: Generator
) -> Draft | None:
    """Return a draft of a system with a unit of another one; None if there is no room or no unit.

    The states of the other system are predicted by those of the first, by least squares over the estimation
    data, so that the argument of the unit remains the same signal as far as possible.
    """
    if not other.units or len(system.units) >= MOST_UNITS:
        return None
    states, others = _simulate_states(system, data), _simulate_states(other, data)
    regressors = np.column_stack([states, np.ones(len(states))])
    solution = np.linalg.lstsq(regressors, others, rcond=None)[0]
    to_other, shift = solution[:-1].T, solution[-1]
    unit = int(rng.integers(len(other.units)))
    blocks, free = (other.layout.split(array) for array in (np.array(other.theta), np.array(other.free)))
    weights, used = blocks["W"][unit], free["W"][unit]
    of_states, of_inputs = weights[: other.order], weights[other.order :]
    effect = np.linalg.lstsq(to_other, blocks["E"][:, unit], rcond=None)[0]
    values = {
        "E": _INHERITED * effect,
        "F": _INHERITED * blocks["F"][[unit]],
        "W": np.concatenate([of_states @ to_other, of_inputs]),
        "s": blocks["s"][[unit]] + of_states @ shift,
    }
    read = np.repeat([used[: other.order].any(), used[other.order :].any()], [system.order, other.inputs])
    moved = np.full(system.order, free["E"][:, unit].any())
    is_free = {"E": moved, "F": free["F"][[unit]], "W": read, "s": np.ones(1, bool)}
    unit_of_other = NewUnit(other.units[unit], values, is_free)
    return _append_units(system.draft(), [unit_of_other]).restrict(structure)


def mutate(system: FittedStateSpace, structure: str, rng: Generator) -> Draft:
    """Return a draft of a system after a mutation, or one that is estimated further."""
    names = list(_MUTATIONS)
    weights = np.array([_MUTATIONS[name][0] for name in names])
    drawn = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    found = _MUTATIONS[drawn][1](system, rng)
    return _continue(system, rng) if found is None else found.restrict(structure)


def _simulate_states(system: FittedStateSpace, data: LatentData) -> NDArray[np.float64]:
    """Return the states over the first rows of all blocks, one after the other."""
    theta, codes, found = np.array(system.theta), find_codes(system.units), []
    for block, start in zip(data.delay(system.delays).used, system.states, strict=True):
        u = block.u[:_COMPARED_ROWS]
        states = np.empty((len(u), system.order))
        simulate_states(theta, codes, u, np.array(start), states)
        found.append(states)
    return np.concatenate(found)


def _draw_unit(system: FittedStateSpace, function: str, rng: Generator) -> NewUnit:
    order, width = system.order, system.order + system.inputs
    values = {
        "E": _EFFECT * rng.standard_normal(order),
        "F": _EFFECT * rng.standard_normal(1),
        "W": rng.standard_normal(width) / np.sqrt(width),
        "s": _OFFSET * rng.standard_normal(1),
    }
    return NewUnit(function, values, {name: np.ones(each.size, bool) for name, each in values.items()})


def _append_units(draft: Draft, units: Sequence[NewUnit]) -> Draft:
    """Return a draft with further units, the effects of which are estimated first."""
    return replace(draft.append(units), steps=STEPS, effect_steps=EFFECT_STEPS)


def _take(draft: Draft, states: Sequence[int], units: Sequence[int], effect_steps: int) -> Draft:
    """Return a draft with some of the states and units only."""
    return replace(draft.take(states, units), steps=STEPS, effect_steps=effect_steps if units else 0)


def _add_unit(system: FittedStateSpace, rng: Generator) -> Draft | None:
    if len(system.units) >= MOST_UNITS:
        return None
    return _append_units(system.draft(), [_draw_unit(system, _draw_function(rng), rng)])


def _replace_unit(system: FittedStateSpace, rng: Generator) -> Draft | None:
    """Replace the function of a unit. Its argument remains, and its effects are estimated again."""
    if not system.units:
        return None
    place = int(rng.integers(len(system.units)))
    weights, offsets = (system.layout.split(np.array(system.theta))[name] for name in ("W", "s"))
    drawn = _draw_unit(system, _vary_function(system.units[place], rng), rng)
    kept = {**drawn.values, "W": weights[place], "s": offsets[[place]]}
    left = _take(system.draft(), range(system.order), _others(system.units, place), 0)
    return _append_units(left, [drawn._replace(values=kept)])


def _remove_unit(system: FittedStateSpace, rng: Generator) -> Draft | None:
    if not system.units:
        return None
    left = _others(system.units, int(rng.integers(len(system.units))))
    return _take(system.draft(), range(system.order), left, 0)


def _add_state(system: FittedStateSpace, rng: Generator) -> Draft | None:
    """Add a state that a random pole and the inputs move, with a small effect on the others."""
    if system.order >= MOST_STATES:
        return None
    order, units, pole = system.order, len(system.units), rng.uniform(*_POLES)
    draft = system.draft()
    blocks, free = draft.layout.split(draft.theta), draft.layout.split(draft.free)
    row = np.append(_COUPLING * rng.standard_normal(order), pole)
    column = _COUPLING * rng.standard_normal((order, 1))
    value = {
        "A": np.vstack([np.hstack([blocks["A"], column]), row]),
        "B": np.vstack([blocks["B"], (1.0 - pole) * rng.standard_normal(system.inputs)]),
        "C": np.append(blocks["C"], _COUPLING * rng.standard_normal()),
        "E": np.vstack([blocks["E"], _EFFECT * rng.standard_normal(units)]),
        "W": np.insert(blocks["W"], order, 0.0, axis=1),
        "o": np.append(blocks["o"], 0.0),
    }
    is_free = {
        "A": np.ones((order + 1, order + 1), bool),
        "B": np.vstack([free["B"], np.ones(system.inputs, bool)]),
        "C": np.append(free["C"], True),
        "E": np.vstack([free["E"], free["E"].any(axis=0)]),
        "W": np.insert(free["W"], order, free["W"][:, :order].any(axis=1), axis=1),
        "o": np.append(free["o"], True),
    }
    states = np.column_stack([draft.states, np.zeros(len(draft.states))])
    layout = replace(draft.layout, order=order + 1)
    theta, used = layout.join({**blocks, **value}), layout.join({**free, **is_free})
    return replace(draft, layout=layout, theta=theta, free=used, states=states, steps=STEPS)


def _remove_state(system: FittedStateSpace, rng: Generator) -> Draft | None:
    if system.order == 1:
        return None
    left = _others(range(system.order), int(rng.integers(system.order)))
    return _take(system.draft(), left, range(len(system.units)), EFFECT_STEPS)


def _remove_connection(system: FittedStateSpace, rng: Generator) -> Draft | None:
    """Fix a kind of connection of a unit, or the direct effect of the inputs, at zero."""
    draft = system.draft()
    blocks, order = draft.layout.split(draft.free), system.order
    units = range(len(system.units))
    known = [blocks["D"], *(blocks["F"][unit : unit + 1] for unit in units)]
    known += [
        part for unit in units for part in (blocks["E"][:, unit], *np.split(blocks["W"][unit], [order]))
    ]
    used = [each for each in known if each.any()]
    if not used:
        return None
    used[int(rng.integers(len(used)))][...] = False
    return replace(draft, steps=STEPS, effect_steps=EFFECT_STEPS if system.units else 0)


def _disturb(system: FittedStateSpace, rng: Generator) -> Draft | None:
    """Disturb the arguments of the units; their effects are estimated first."""
    if not system.units:
        return None
    draft = system.draft()
    blocks = draft.layout.split(draft.theta)
    blocks["W"][...] *= 1.0 + _DISTURBANCE * rng.standard_normal(blocks["W"].shape)
    blocks["s"][...] += _DISTURBANCE * rng.standard_normal(len(system.units))
    return replace(draft, steps=STEPS, effect_steps=EFFECT_STEPS)


def _continue(system: FittedStateSpace, _rng: Generator) -> Draft:
    return replace(system.draft(), steps=FURTHER_STEPS)


def _others(items: Sequence[Any], place: int) -> list[int]:
    """Return all places but one."""
    return [each for each in range(len(items)) if each != place]


def _draw_function(rng: Generator) -> str:
    return list(FUNCTIONS)[int(rng.integers(len(FUNCTIONS)))]


def _vary_function(function: str, rng: Generator) -> str:
    """Return another function, or a tree about the function or within it."""
    tree, argument = parse_unit(function), UnitFunction(ARGUMENT)
    drawn = UnitFunction(_draw_function(rng), (argument,))
    parts = [operand for operand in tree.operands if operand.operands]
    larger = [
        UnitFunction(drawn.name, (tree,)),
        UnitFunction(PRODUCT, (tree, argument)),
        UnitFunction(PRODUCT, (tree, drawn)),
    ]
    trees = [*parts, *(each for each in larger if each.operations <= MOST_OPERATIONS)]
    if rng.random() < _ANOTHER_FUNCTION or not trees:
        return str(drawn)
    return str(trees[int(rng.integers(len(trees)))])


#: Relative frequency of each mutation, and its function, which returns None if it does not apply.
_MUTATIONS: Mapping[str, tuple[float, Callable[[FittedStateSpace, Generator], Draft | None]]] = (
    MappingProxyType(
        {
            "add a unit": (0.22, _add_unit),
            "replace the function of a unit": (0.16, _replace_unit),
            "remove a unit": (0.08, _remove_unit),
            "add a state": (0.10, _add_state),
            "remove a state": (0.06, _remove_state),
            "remove a connection": (0.10, _remove_connection),
            "disturb the arguments": (0.10, _disturb),
            "estimate further": (0.18, _continue),
        }
    )
)
