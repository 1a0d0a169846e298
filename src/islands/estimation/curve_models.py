"""Linear systems with one curve, the simplest nonlinear models of a record with dynamics.

A curve is a unit that reads one signal: an input, or the output of the linear system. Every function of
`FUNCTIONS` is tried at a few offsets, from each of a few linear systems. Its effects begin at zero, and are
the first parameters that are estimated. The best curves are estimated further. The search is deterministic.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from islands.estimation.fitted_state_space import Draft, FittedStateSpace, NewUnit
from islands.estimation.latent_data import LatentData, make_latent_data
from islands.estimation.latent_models import estimate_models, find_front, fit_linear_systems, make_odd
from islands.estimation.model_cache import share_models
from islands.models.latent import LatentModel
from islands.models.unit_functions import FUNCTIONS, parse_unit
from islands.parallel import map_over_record, one_blas_thread
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset

#: Offsets of the argument of a curve, in standard deviations of the signal that it reads.
_OFFSETS = (-1.0, 0.0, 1.0)

#: Orders of the linear systems that get a curve, besides that of the least error: a curve replaces states.
_ORDERS = (1, 2)

#: Steps of the effects, steps of all parameters, and systems that are kept, of every round.
_ROUNDS = ((5, 5, 48), (0, 12, 16), (0, 40, 8))

#: Gain of the held-out error, as a fraction, that justifies a curve.
_GAIN = 0.15


@share_models
def identify_curve_models(record: Dataset, steps: Steps) -> list[LatentModel]:
    """Identify linear systems with one curve.

    Parameters
    ----------
    record : Dataset
        Record without missing values. An output reads inputs of the same sample if all inputs are read one
        sample early.
    steps : Steps
        Receives what is estimated, and may stop.

    Returns
    -------
    list of LatentModel
        Models each of which has a smaller held-out error than all smaller ones and the linear systems.

    Raises
    ------
    RecordError
        The record is too short.
    StoppedError
        A stop is requested.
    """
    data = make_latent_data(record)
    linear = fit_linear_systems(record, data, steps)
    front = find_front([*linear, *add_curves(linear, data, steps=steps)], _GAIN)
    direct = all(parse_channel_name(name).at_once for name in record.input_names)
    return estimate_models([each for each in front if each.units], record, steps, direct=direct)


@one_blas_thread
def add_curves(
    linear: Sequence[FittedStateSpace], data: LatentData, structure: str = "auto", *, steps: Steps
) -> list[FittedStateSpace]:
    """Return linear systems with one curve, those with the least held-out errors first.

    Parameters
    ----------
    linear : sequence of FittedStateSpace
    data : LatentData
    structure : str
        An entry of ``ZERO_BLOCKS``.
    steps : Steps

    Raises
    ------
    StoppedError
        A stop is requested.
    """
    drafts = [
        make_odd(draft.restrict(structure), data)
        for system in _take_starts(linear)
        for draft in _list_drafts(system, data)
    ]
    found: list[FittedStateSpace] = []
    rows = sum(len(each.y) for each in data.used)

    def estimate(effect_steps: int, all_steps: int, draft: Draft) -> FittedStateSpace | None:
        steps.check("linear models with one curve")
        estimated = replace(draft, effect_steps=effect_steps, steps=all_steps).estimate(data)
        return estimated if isinstance(estimated, FittedStateSpace) else None

    for effect_steps, all_steps, kept in _ROUNDS:
        steps.report(f"{len(drafts)} linear models with one curve", None)
        tried = map_over_record(partial(estimate, effect_steps, all_steps), drafts, rows)
        found = sorted(filter(None, tried), key=lambda each: (each.fitness, each.key, each.theta))[:kept]
        drafts = [each.draft() for each in found]
    return found


def _take_starts(linear: Sequence[FittedStateSpace]) -> list[FittedStateSpace]:
    """Return the best linear system, and the best ones of the smallest orders."""
    best: dict[int, FittedStateSpace] = {}
    for each in sorted(linear, key=lambda each: (each.fitness, each.key)):
        best.setdefault(each.order, each)
    ordered = list(best.values())
    return [each for each in ordered if each is ordered[0] or each.order in _ORDERS]


def _list_drafts(system: FittedStateSpace, data: LatentData) -> Iterator[Draft]:
    """Yield drafts of a linear system with one curve of each signal."""
    order, scales, blocks = system.order, data.scales, system.layout.split(np.array(system.theta))
    read = np.zeros((1 + system.inputs, order + system.inputs))
    read[0, :order] = blocks["C"]
    read[1:, order:] = np.eye(system.inputs)
    # Laws in absolute units, as the root of a level, bend at the zero of the unit.
    zeros = [blocks["level"][0] + scales.level / scales.height, *(scales.mean / scales.deviation)]
    # A static system has no output of its states.
    for weights, zero in list(zip(read, zeros, strict=True))[not order :]:
        for function, offset in product(FUNCTIONS, (*_OFFSETS, float(zero))):
            for sign in (1.0,) if parse_unit(function).parity else (1.0, -1.0):
                yield _append_curve(system.draft(), function, sign * weights, sign * offset)


def _append_curve(draft: Draft, function: str, weights: NDArray[np.float64], offset: float) -> Draft:
    """Return a draft with a curve that has no effect yet, and whose argument keeps its kind of signal."""
    order, inputs = draft.layout.order, draft.layout.inputs
    reads_states = bool(weights[:order].any())
    values = {"E": np.zeros(order), "F": np.zeros(1), "W": weights, "s": np.array([offset])}
    free = {name: np.ones(each.size, bool) for name, each in values.items()}
    free["W"] = np.repeat([reads_states, not reads_states], [order, inputs])
    return draft.append([NewUnit(function, values, free)])
