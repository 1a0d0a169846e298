"""Models of state spaces: linear systems of several orders, and the final estimation of a front.

Of the systems that no other one exceeds in size and held-out error, blocks of parameters that the error does
not need are removed. The others are estimated on longer blocks and written in the units of the record.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import log

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from islands.errors import RecordError
from islands.estimation.balanced_form import find_balanced_form
from islands.estimation.constraints.state_space import take_system
from islands.estimation.constraints.static_state import StateSpaceParameters
from islands.estimation.fitted_state_space import Draft, FittedStateSpace
from islands.estimation.latent_data import (
    LARGEST_MEMORY,
    LatentData,
    estimate_start,
    make_latent_data,
    measure_deviations,
    measure_held_out,
)
from islands.estimation.linear.latent import identify_linear_models
from islands.estimation.modal_form import find_modal_form
from islands.kernels.state_space import evaluate_unit
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.models.unit_functions import find_codes, make_odd_unit
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome

#: Largest order of a linear system whose matrix A is free. A system of 12 states has 144 entries, and 24 in
#: its modes.
_LARGEST_FULL = 6

#: Steps of a linear system, of a system without some parameters, and of the final estimation.
_LINEAR_STEPS, _REDUCED_STEPS, _FINAL_STEPS = 10, 15, 50

#: Gain of the held-out error, as a fraction, that justifies further parameters; increase by a removal, and
#: by the final estimation.
_NEGLIGIBLE, _LARGEST_INCREASE, _LARGEST_FINAL_INCREASE = 0.01, 0.02, 0.5

#: Largest part of a segment that gives the initial states of a free run of the result.
_LARGEST_PART = 0.05

#: Samples for each state from which the initial states of a free run of the result are estimated, at least.
_SAMPLES_PER_STATE = 3

#: Part to which a mode decays in the warm-up.
_DECAY = 0.01


def search_linear_models(record: Dataset, steps: Steps) -> list[LatentModel]:
    """Search state spaces without units: the linear models of the same data.

    Parameters
    ----------
    record : Dataset
        Record without missing values.
    steps : Steps

    Returns
    -------
    list of LatentModel
        Models that no other one exceeds in both the number of parameters and the held-out error, the smallest
        first; the last one has the least error. Empty if the record is too short.
    """
    data = make_latent_data(record)
    return estimate_models(find_front(fit_linear_systems(record, data, steps)), record, steps)


def fit_linear_systems(record: Dataset, data: LatentData, steps: Steps) -> list[FittedStateSpace]:
    """Fit linear systems of several orders to the blocks, from the linear models of the record.

    The dead times are those of the best linear model, or none. A direct path is estimated with the systems.

    Parameters
    ----------
    record : Dataset
        Record of the data, whose inputs need not be read one sample early.
    data : LatentData
    steps : Steps

    Raises
    ------
    RecordError
        The record is too short.
    StoppedError
        A stop is requested.
    """
    try:
        # A fit of the same record has identified these models already.
        models = identify_linear_models(record, steps)
    except RecordError:
        # The output may follow an input within the sample.
        models = identify_linear_models(data.record, steps)
    drafts = [
        _begin(model, delays, data)
        for model in sorted(models, key=lambda model: model.order)
        for delays in dict.fromkeys([models[0].delays, (0,) * data.record.inputs])
        if model.order
    ]
    found = [make_odd(each, data).estimate(data) for each in drafts]
    return [each for each in found if isinstance(each, FittedStateSpace)]


def _begin(model: LatentModel, delays: tuple[int, ...], data: LatentData) -> Draft:
    """Return a draft of a linear model with given dead times, of a large one with its modes only."""
    layout, theta = model.layout, data.scales.use_scaled_units(model.layout, model.theta)
    late, free, blocks = data.delay(delays), _free_modes(layout, theta), layout.split(theta)
    # The states move about zero.
    decay = np.eye(model.order) - blocks["A"]
    rest = np.linalg.lstsq(decay, blocks["o"], rcond=1e-12)[0]
    blocks["o"] -= decay @ rest
    blocks["level"] += blocks["C"] @ rest
    if model.order <= _LARGEST_FULL:
        balanced = transform_states(theta, layout, find_balanced_form(blocks["A"], blocks["B"], blocks["C"]))
        scales = measure_deviations(balanced, model.codes, late.used[0].u, np.zeros(model.order))
        theta = balanced if scales is None else transform_states(balanced, layout, np.diag(scales))
        free = np.ones(theta.size, bool)
    states = np.array([estimate_start(theta, model.codes, each, model.order) for each in late.used])
    return Draft(layout, (), theta, free, states, _LINEAR_STEPS, delays=delays if any(delays) else ())


def meet_conditions(
    systems: Sequence[FittedStateSpace], data: LatentData, steps: Steps
) -> list[FittedStateSpace]:
    """Return the systems that can meet the static conditions, estimated under them."""
    if not data.stated.statics:
        return list(systems)
    steps.report("estimation of state spaces under the constraints", 0.65)
    drafts = [replace(each.draft(), steps=_REDUCED_STEPS) for each in systems]
    # The sums of a matrix product depend on the number of threads of the library.
    with threadpool_limits(1), ThreadPoolExecutor() as threads:
        found = list(threads.map(lambda draft: draft.estimate(data), drafts))
    return [each for each in found if isinstance(each, FittedStateSpace)]


def make_odd(draft: Draft, data: LatentData) -> Draft:
    """Return a draft of an odd system without offsets if the models are to be odd."""
    if not data.stated.is_odd:
        return draft
    free = draft.free.copy()
    blocks = draft.layout.split(free)
    for name in ("s", "o", "level"):
        blocks[name][...] = False
    return replace(draft, units=tuple(map(make_odd_unit, draft.units)), free=free)


def _free_modes(layout: StateSpaceLayout, theta: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which parameters of a system in modes are free: not the entries of A between two modes."""
    free = np.ones(theta.size, bool)
    blocks = layout.split(free)
    blocks["A"][...] = layout.split(theta)["A"] != 0.0
    # The level of the output determines the drift of a linear system.
    blocks["o"][...] = False
    return free


def find_front(systems: Sequence[FittedStateSpace], gain: float = _NEGLIGIBLE) -> list[FittedStateSpace]:
    """Return the systems each of which has a smaller error, by a fraction, than all smaller ones."""
    front: list[FittedStateSpace] = []
    for each in sorted(systems, key=lambda each: (each.size, each.fitness, each.key, each.theta)):
        if not front or each.fitness < (1.0 - gain) * front[-1].fitness:
            front.append(each)
    return front


def estimate_models(
    front: Sequence[FittedStateSpace],
    record: Dataset,
    steps: Steps,
    constraints: str = "none",
    *,
    direct: bool = True,
) -> list[LatentModel]:
    """Reduce the systems of a front, estimate them on longer blocks, and return the models.

    If the output of the system with the least error reads an input at sample k, the inputs of all models are
    read one sample early. The output of no model reads one otherwise.

    Parameters
    ----------
    front : sequence of FittedStateSpace
        The smallest first. No models if it is empty.
    record : Dataset
    steps : Steps
    constraints : str
        Statements about the models; see `find_conditions`. Systems that cannot meet them are left out.
    direct : bool
        Whether the output may read an input at sample k.
    """
    if not front:
        return []
    steps.report("final estimation of state spaces", 0.7)
    data = make_latent_data(record, constraints)
    with ThreadPoolExecutor() as threads:
        best = _remove_blocks(front[-1], data, direct=direct)
        direct = best.reads_at_once
        left = front[:-1] if direct else front
        reduced = list(threads.map(partial(_remove_blocks, data=data, direct=direct), left))
        reduced += [best] if direct else []
        # Systems may be equal once blocks are removed.
        different = {each.key: each for each in map(_remove_idle_units, reduced)}
        # The largest ones take the longest time: the others use the other threads in the meantime.
        finished = threads.map(partial(_finish, data=data, steps=steps), list(different.values())[::-1])
        models = [make_latent_model(each, data) for each in finished if each is not None][::-1]
    models = [each for each in models if data.stated.are_met(take_system(each))]
    return models if direct else [replace(each, input_names=record.input_names) for each in models]


def _remove_blocks(system: FittedStateSpace, data: LatentData, direct: bool) -> FittedStateSpace:
    """Return the system without the blocks of parameters that the held-out error does not need.

    Without ``direct``, the output reads no input of the same sample: units read none, or it reads no unit.
    """
    blocks = system.layout.split(np.arange(len(system.theta)))
    of_states, of_inputs = blocks["W"][:, : system.order].ravel(), blocks["W"][:, system.order :].ravel()
    through, past = blocks["D"], blocks["F"]
    at_once = np.flatnonzero(np.array(system.delays or (0,) * system.inputs) == 0)
    if at_once.size and not direct:
        read = blocks["W"][:, system.order + at_once].ravel()
        tried = [_fit_without(system, np.append(through[at_once], each), data) for each in (past, read)]
        system = min(tried, key=lambda each: each.fitness)
    for block in (past, through, of_inputs, of_states):
        if np.array(system.free)[block].any():
            found = _fit_without(system, block, data)
            if found.fitness <= (1.0 + _LARGEST_INCREASE) * system.fitness:
                system = replace(found, fitness=min(found.fitness, system.fitness))
    return system


def _fit_without(system: FittedStateSpace, block: NDArray[np.int64], data: LatentData) -> FittedStateSpace:
    """Return the system without some parameters; its error is infinite if it cannot be estimated."""
    draft = system.draft()
    free = draft.free.copy()
    free[block] = False
    found = replace(draft, free=free, steps=_REDUCED_STEPS).estimate(data)
    if isinstance(found, EvaluationOutcome):
        theta = tuple(np.where(free, draft.theta, 0.0).tolist())
        return replace(system, theta=theta, free=tuple(free.tolist()), fitness=np.inf)
    return found


def _remove_idle_units(system: FittedStateSpace) -> FittedStateSpace:
    """Return the system without units that act on nothing or read nothing; the latter are constants."""
    draft = system.draft()
    values, free = draft.layout.split(draft.theta), draft.layout.split(draft.free)
    acts = free["E"].any(axis=0) | free["F"]
    kept = [unit for unit in range(len(system.units)) if acts[unit] and free["W"][unit].any()]
    if len(kept) == len(system.units):
        return system
    pairs = zip(find_codes(system.units), values["s"], strict=True)
    constants = np.array([evaluate_unit(code, s)[0] for code, s in pairs])
    constants[kept] = 0.0
    values["o"] += values["E"] @ constants
    values["level"] += values["F"] @ constants
    free["o"] |= values["o"] != 0.0
    free["level"] |= values["level"] != 0.0
    taken = draft.take(range(system.order), kept)
    theta, used = tuple(taken.theta.tolist()), tuple(taken.free.tolist())
    return replace(system, units=taken.units, theta=theta, free=used)


def _finish(system: FittedStateSpace, data: LatentData, steps: Steps) -> FittedStateSpace | None:
    """Estimate on longer blocks, unless the error of other rows or of disturbed states increases much.

    None if the system cannot meet the conditions.
    """
    draft, data = system.draft(), data.delay(system.delays)
    fit = draft.begin(data.final, data.conditions)
    fit.advance(_FINAL_STEPS, lambda: steps.skip("refinement of parameters"))
    if not fit.meets_conditions:
        return None
    error = measure_held_out(fit, data)
    if not error <= (1.0 + _LARGEST_FINAL_INCREASE) * system.fitness:
        return system
    return draft.describe(fit, error)


def _write_in_modes(
    layout: StateSpaceLayout,
    theta: NDArray[np.float64],
    units: Sequence[str],
    u: NDArray[np.float64],
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the parameters with one or two states for each mode, of the standard deviation 1 for inputs.

    Parameters
    ----------
    layout, theta, units
        Of a system.
    u : ndarray, shape (rows, inputs)
    start : ndarray, shape (states,)
        States at the first row.
    """
    found = find_modal_form(layout.split(theta)["A"]) if layout.order else None
    if found is None:
        return theta
    blocks, forward = found
    modal = transform_states(theta, layout, forward)
    layout.split(modal)["A"][...] = blocks
    first = np.linalg.solve(forward, start).astype(np.float64)
    scales = measure_deviations(modal, find_codes(units), u, first)
    if scales is None:
        return theta
    for state, next_state in pairwise(range(layout.order)):
        if blocks[state, next_state]:  # both states of a pair have one scale
            scales[[state, next_state]] = np.hypot(*scales[[state, next_state]])
    scaled = transform_states(modal, layout, np.diag(scales))
    layout.split(scaled)["A"][...] = blocks
    return scaled if np.isfinite(scaled).all() else theta


def transform_states(
    theta: NDArray[np.float64], layout: StateSpaceLayout, forward: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters for the states z of ``x = T z``."""
    found = theta.copy()
    blocks = layout.split(found)
    for name in ("A", "B", "E", "o"):
        block = blocks[name]
        block[...] = np.linalg.solve(forward, block.reshape(layout.order, -1)).reshape(block.shape)
    blocks["A"][...] = blocks["A"] @ forward
    blocks["C"][...] = blocks["C"] @ forward
    blocks["W"][:, : layout.order] = blocks["W"][:, : layout.order] @ forward
    return found


def make_latent_model(system: FittedStateSpace, data: LatentData) -> LatentModel:
    """Return the model of a system in the units of a record.

    Parameters
    ----------
    system : FittedStateSpace
    data : LatentData
        Blocks of the record.
    """
    layout, record, data = system.layout, data.record, data.delay(system.delays)
    theta = _write_in_modes(
        layout, np.array(system.theta), system.units, data.used[0].u, np.array(system.states[0])
    )
    radius = float(np.abs(np.linalg.eigvals(layout.split(theta)["A"])).max(initial=0.0))
    # Changes of units and coordinates round: the corrections restore the last digits.
    theta = data.stated.polish(
        StateSpaceParameters(layout, data.scales.use_record_units(layout, theta), find_codes(system.units))
    )
    wiring = tuple(name for name, value in zip(layout.names, theta, strict=True) if value != 0.0)
    decay = log(_DECAY) / log(min(max(radius, 1e-3), 1.0 - 1e-6))
    shortest = min(record.segments) * _LARGEST_PART
    # The first sample of a segment lacks its input, and those before a dead time.
    memory = 1 + max(system.delays, default=0)
    memory += round(max(1, _SAMPLES_PER_STATE * layout.order, min(LARGEST_MEMORY - 1, decay, shortest)))
    return LatentModel(
        order=layout.order,
        units=system.units,
        wiring=wiring,
        memory=memory,
        operating_inputs=data.operating_inputs,
        delays=system.delays,
        limits=data.limits,
        parameters=tuple(value for value in theta.tolist() if value != 0.0),
        input_names=record.input_names,
        output_name=record.output_name,
        dt=record.dt,
        preprocessing=record.preprocessing,
    )
