"""Search of state spaces with static units by the error of the free run.

Linear models of several orders are the starts. Units are added with random directions and negligible
effects. The effects are estimated first, then all parameters. Starts race (successive halving: Karnin, Koren
and Somekh 2013): after some steps, those with larger errors on held-out blocks are left. The blocks are
spread over the record, because the least error on the estimation data prefers models that are too large.
Parameters that the held-out error does not need are removed in the end.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import isfinite, log

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.data.input_lead import advance_all_inputs
from islands.errors import lookup
from islands.estimation.linear_state_space import fit_linear_state_space, measure_deviations
from islands.estimation.modal_form import find_modal_form
from islands.estimation.state_space_fit import StateSpaceFit
from islands.models.latent import ZERO_BLOCKS, LatentModel, StateSpaceLayout, find_codes, read_at_once
from islands.progress import Steps
from islands.simulation.initial_states import Segment, estimate_states, simulate_errors

#: Numbers of states of the linear models.
_ORDERS = (1, 2, 3, 4, 6)

#: Units that are tried with every order.
_UNITS = (
    *(("tanh",) * count for count in (1, 2, 4, 6)),
    *((name,) for name in ("square", "cube", "abs", "root")),
    ("square", "cube"),
    *((name,) * 2 for name in ("hinge", "saturation", "dead zone", "bell")),
)

#: Random starts of each order and units.
_STARTS = 2

#: Orders whose linear model has larger mean squared errors than this multiple of the least are left out. On
#: held-out rows, a linear model may drift whose units would not.
_LARGEST_RATIO = 4.0

#: Steps of the effects of the units, then of all parameters before the first comparison.
_FIRST_STEPS, _TRIAL_STEPS = 6, 10

#: Rounds of the race: steps, and models that are left before them.
_ROUNDS = ((15, 12), (40, 6), (150, 3))

#: Blocks of a record, samples of a block at least and at most, and the part of each that is held out. Slow
#: states are not visible in short blocks.
_BLOCKS, _SMALLEST_BLOCK, _LARGEST_BLOCK, _HELD_OUT = 5, 500, 4_000, 0.2

#: Samples from which the initial states of a block are estimated, at least for a state and at most.
_SAMPLES_PER_STATE, _LARGEST_MEMORY = 3, 100

#: Largest part of a segment that gives the initial states of a free run of the result.
_LARGEST_PART = 0.05

#: Part to which a mode decays in the warm-up.
_DECAY = 0.01

#: Standard deviations of random directions and offsets of the units, and of their first effects.
_OFFSET, _EFFECT = 0.7, 1e-3

#: Gain of the held-out error, as a fraction, that justifies further parameters; increase by a removal.
_NEGLIGIBLE, _LARGEST_INCREASE = 0.01, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class _Data:
    """A record with the standard deviation 1 of all signals, in blocks.

    Attributes
    ----------
    record : Dataset
    used : tuple of Segment
        Blocks for the estimation.
    whole : tuple of Segment
        The same blocks with the rows after them, which are held out for the comparison of models.
    """

    record: Dataset
    used: tuple[Segment, ...]
    whole: tuple[Segment, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A fit of a structure, and its error on the held-out blocks."""

    layout: StateSpaceLayout
    units: tuple[str, ...]
    start: int
    fit: StateSpaceFit
    error: float

    @property
    def order(self) -> tuple[float, int, tuple[str, ...], int]:
        """Sort key: the error; ties are broken by the structure."""
        return self.error, self.layout.order, self.units, self.start

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return int(np.count_nonzero(self.fit.places >= 0))

    @property
    def reads_at_once(self) -> bool:
        """Whether the output reads an input at the same row."""
        named = zip(self.layout.names, self.fit.theta, strict=True)
        return read_at_once([name for name, value in named if value != 0.0])

    def advance(self, steps: int, data: _Data, stop: Steps) -> "_Candidate":
        """Return the candidate after some steps."""
        self.fit.advance(steps, lambda: stop.skip("refinement of parameters"))
        return replace(self, error=_measure(self.fit, data))


def search_latent_models(
    record: Dataset, seed: int, steps: Steps, structure: str = "auto"
) -> list[LatentModel]:
    """Search state spaces with static units.

    Parameters
    ----------
    record : Dataset
        Record without missing values.
    seed : int
        Seed of the random starts.
    steps : Steps
    structure : str
        An entry of ``ZERO_BLOCKS``. In a Wiener system the units follow the dynamics and the output alone
        reads them, in a Hammerstein system they read the inputs alone, and with feedback the output reads the
        states alone.

    Raises
    ------
    SettingsError
        The structure is unknown.

    Returns
    -------
    list of LatentModel
        Models that no other one exceeds in both the number of parameters and the held-out error, the smallest
        first. They are estimated on all blocks. If the output of the one with the least error reads an input
        at sample k, the inputs of all are read one sample early. Empty if the record is too short.
    """
    zeros = lookup(ZERO_BLOCKS, structure, "structure")
    advanced = advance_all_inputs(record)
    data = _make_data(advanced)
    linear = _fit_linear(data, steps)
    if not linear:
        return []
    candidates = list(linear)
    starts = [
        (each, units, start) for each in _keep_orders(linear) for units in _UNITS for start in range(_STARTS)
    ]

    def begin(entry: tuple[_Candidate, tuple[str, ...], int]) -> _Candidate | None:
        return None if steps.skip("starts of further units") else _begin(*entry, zeros, data, seed, steps)

    with ThreadPoolExecutor() as threads:
        steps.report("starts of state spaces with units", 0.1)
        candidates += [each for each in threads.map(begin, starts) if each is not None]
        for number, (count, most) in enumerate(_ROUNDS, start=1):
            steps.report(f"round {number} of {len(_ROUNDS)} of the race of state spaces", 0.2 + 0.15 * number)
            front = _find_front(candidates)
            ranked = sorted(candidates, key=lambda each: each.order)
            kept = {id(each): each for each in (*ranked[:most], *front)}
            racing = [each for each in kept.values() if each.units]
            moved = threads.map(partial(_Candidate.advance, steps=count, data=data, stop=steps), racing)
            candidates = [each for each in candidates if not each.units] + list(moved)
        return _estimate_front(candidates, data, record, advanced, threads, steps)


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
        As of `search_latent_models`. The last one has the least error on the held-out blocks.
    """
    advanced = advance_all_inputs(record)
    data = _make_data(advanced)
    linear = _fit_linear(data, steps)
    if not linear:
        return []
    with ThreadPoolExecutor() as threads:
        return _estimate_front(linear, data, record, advanced, threads, steps)


def _estimate_front(
    candidates: Sequence[_Candidate],
    data: _Data,
    record: Dataset,
    advanced: Dataset,
    threads: ThreadPoolExecutor,
    steps: Steps,
) -> list[LatentModel]:
    """Reduce the models of the front, estimate them on all blocks, and return them.

    ``advanced`` is the record with all inputs one sample early.
    """
    steps.report("final estimation of state spaces", 0.7)
    front = _find_front(candidates)
    best = _remove_blocks(front[-1], data, direct=True)
    direct = best.reads_at_once
    left = front[:-1] if direct else front
    reduced = list(threads.map(partial(_remove_blocks, data=data, direct=direct), left))
    reduced += [best] if direct else []
    found = threads.map(partial(_finish, data=data, record=advanced, steps=steps), reduced)
    models = [each for each in found if each is not None]
    return models if direct else [replace(each, input_names=record.input_names) for each in models]


def _make_data(record: Dataset) -> _Data:
    """Scale a record and cut blocks out of it."""
    scaled = replace(
        record,
        u=(record.u - record.u.mean(axis=0)) / _deviation(record.u),
        y=(record.y - record.y.mean()) / _deviation(record.y),
        preprocessing=None,
    )
    used: list[Segment] = []
    whole: list[Segment] = []
    for begin, end in _cut_blocks(scaled):
        cut = end - round(_HELD_OUT * (end - begin))
        used.append(_take(scaled, begin, cut))
        whole.append(_take(scaled, begin, end))
    return _Data(scaled, tuple(used), tuple(whole))


def _deviation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of each column, 1 for a constant."""
    found = values.std(axis=0)
    return np.where(found > 0.0, found, 1.0)


def _cut_blocks(record: Dataset) -> Iterator[tuple[int, int]]:
    """Yield the first and the last row of each block; blocks do not cross segments."""
    share = max(_SMALLEST_BLOCK, record.samples // _BLOCKS)
    for begin, end in record.bounds:
        count = max(1, round((end - begin) / share))
        cuts = np.linspace(begin, end, count + 1).astype(int).tolist()
        for first, last in pairwise(cuts):
            yield first, min(last, first + _LARGEST_BLOCK)


def _take(record: Dataset, begin: int, end: int) -> Segment:
    """Return rows with the inputs at the same samples."""
    # All inputs are read one sample early, so that the first row of a segment lacks them.
    first = begin + 1 if begin in {bounds[0] for bounds in record.bounds} else begin
    return Segment(np.ascontiguousarray(record.u[first - 1 : end - 1]), record.y[first:end].copy())


def _fit_linear(data: _Data, steps: Steps) -> list[_Candidate]:
    steps.check("linear state spaces")
    found: list[_Candidate] = []
    for order in _ORDERS:
        if found and steps.skip("linear state spaces of larger orders"):
            break
        steps.report(f"linear state space of order {order}", 0.0)
        model = fit_linear_state_space(data.record[: _BLOCKS * _LARGEST_BLOCK], order)
        if model is None:
            continue
        fit = _make_linear_fit(model.theta, order, data.used)
        fit.advance(_TRIAL_STEPS)
        found.append(_Candidate(model.layout, (), 0, fit, _measure(fit, data)))
    return [each for each in found if isfinite(each.error)]


def _keep_orders(linear: Sequence[_Candidate]) -> list[_Candidate]:
    """Return the linear models whose error on the used or on the held-out rows is close to the least."""
    used = _LARGEST_RATIO * min(each.fit.mean_square for each in linear)
    held_out = _LARGEST_RATIO * min(each.error for each in linear)
    return [each for each in linear if each.fit.mean_square <= used or each.error <= held_out]


def _make_linear_fit(theta: NDArray[np.float64], order: int, segments: Sequence[Segment]) -> StateSpaceFit:
    codes = find_codes(())
    states = [_estimate_start(theta, codes, each, order) for each in segments]
    return StateSpaceFit(theta, np.arange(theta.size), codes, segments, np.array(states))


def _count_memory(segment: Segment, order: int) -> int:
    """Return the number of rows from which initial states are estimated."""
    return min(len(segment.y) // 3, max(_SAMPLES_PER_STATE * order, _LARGEST_MEMORY))


def _estimate_start(
    theta: NDArray[np.float64], codes: NDArray[np.int64], segment: Segment, order: int
) -> NDArray[np.float64]:
    rows = _count_memory(segment, order)
    return estimate_states(theta, codes, Segment(segment.u[:rows], segment.y[:rows]), np.zeros(order))


def _measure(fit: StateSpaceFit, data: _Data) -> float:
    """Return the mean squared error of the held-out rows of all blocks; infinite after a divergence.

    It is the larger one of two free runs. That of the block goes on, since a start at the held-out rows would
    hide the error of slow states. The other starts there from estimated states, as a simulation of the model
    does.
    """
    going_on, started, count, counted = 0.0, 0.0, 0, 0
    for segment, used, states in zip(data.whole, data.used, fit.states, strict=True):
        cut = len(used.y)
        errors = simulate_errors(fit.theta, fit.codes, segment, states)
        held_out = Segment(segment.u[cut:], segment.y[cut:])
        rows = _count_memory(held_out, len(states))
        start = _estimate_start(fit.theta, fit.codes, held_out, len(states))
        again = simulate_errors(fit.theta, fit.codes, held_out, start)
        if errors is None or again is None:
            return np.inf
        going_on += float(np.nansum(errors[cut:] ** 2))
        started += float(np.nansum(again[rows:] ** 2))
        count += int(np.count_nonzero(~np.isnan(errors[cut:])))
        counted += int(np.count_nonzero(~np.isnan(again[rows:])))
    return max(going_on / max(1, count), started / max(1, counted))


def _begin(
    linear: _Candidate,
    units: tuple[str, ...],
    start: int,
    zeros: Sequence[str],
    data: _Data,
    seed: int,
    steps: Steps,
) -> _Candidate:
    """Add units to a linear model, without the blocks that are zero, and estimate."""
    order, inputs, count = linear.layout.order, linear.layout.inputs, len(units)
    layout = StateSpaceLayout(order, inputs, count)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(order, _UNITS.index(units), start)))
    theta, slices, given = np.zeros(len(layout.names)), layout.find_slices(), linear.layout.find_slices()
    for block in ("A", "B", "C", "D", "o", "level"):
        theta[slices[block]] = linear.fit.theta[given[block]]
    theta[slices["E"]] = _EFFECT * rng.standard_normal(order * count)
    theta[slices["F"]] = _EFFECT * rng.standard_normal(count)
    theta[slices["W"]] = rng.standard_normal(count * (order + inputs)) / np.sqrt(order + inputs)
    theta[slices["s"]] = _OFFSET * rng.standard_normal(count)
    codes = find_codes(units)
    free = _find_nonzero(layout, zeros)
    theta[~free] = 0.0
    effects = free.copy()
    effects[slices["W"]] = effects[slices["s"]] = False
    fit = StateSpaceFit(theta, _number(effects), codes, data.used, linear.fit.states.copy())
    fit.advance(_FIRST_STEPS)
    fit.release(_number(free))
    found = _Candidate(layout, units, start, fit, np.inf)
    return found.advance(_TRIAL_STEPS, data, steps)


def _find_nonzero(layout: StateSpaceLayout, zeros: Sequence[str]) -> NDArray[np.bool_]:
    """Return which parameters belong to no block that is zero."""
    slices, every = layout.find_slices(), np.arange(len(layout.names))
    weights = every[slices["W"]].reshape(layout.units, layout.order + layout.inputs)
    blocks = {"W of the states": weights[:, : layout.order].ravel()}
    free = np.ones(every.size, bool)
    for name in zeros:
        free[blocks[name] if name in blocks else every[slices[name]]] = False
    return free


def _number(free: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the columns of the free parameters, -1 for the others."""
    return np.where(free, np.cumsum(free) - 1, -1)


def _find_front(candidates: Sequence[_Candidate]) -> list[_Candidate]:
    """Return the candidates that no other one exceeds in size and error, the smallest first."""
    front: list[_Candidate] = []
    for each in sorted(candidates, key=lambda each: (each.free, each.order)):
        if isfinite(each.error) and (not front or each.error < (1.0 - _NEGLIGIBLE) * front[-1].error):
            front.append(each)
    return front


def _remove_blocks(candidate: _Candidate, data: _Data, direct: bool) -> _Candidate:
    """Return the candidate without the blocks of parameters that the held-out error does not need.

    Without ``direct``, the output reads no input at the same row: the units read none, or it reads no unit.
    """
    layout = candidate.layout
    slices, every = layout.find_slices(), np.arange(len(layout.names))
    weights = every[slices["W"]].reshape(layout.units, layout.order + layout.inputs)
    of_states, of_inputs = weights[:, : layout.order].ravel(), weights[:, layout.order :].ravel()
    through, past = every[slices["D"]], every[slices["F"]]
    if not direct:
        tried = [_fit_without(candidate, np.append(through, each), data) for each in (past, of_inputs)]
        candidate = min(tried, key=lambda each: each.error)
    for block in (past, through, of_inputs, of_states):
        if (candidate.fit.places[block] >= 0).any():
            found = _fit_without(candidate, block, data)
            if found.error <= (1.0 + _LARGEST_INCREASE) * candidate.error:
                candidate = replace(found, error=min(found.error, candidate.error))
    return candidate


def _fit_without(candidate: _Candidate, block: NDArray[np.int64], data: _Data) -> _Candidate:
    """Return the candidate without some parameters, after further steps."""
    theta, free = candidate.fit.theta.copy(), candidate.fit.places >= 0
    theta[block], free[block] = 0.0, False
    fit = StateSpaceFit(theta, _number(free), candidate.fit.codes, data.used, candidate.fit.states.copy())
    fit.advance(_ROUNDS[0][0])
    return replace(candidate, fit=fit, error=_measure(fit, data))


def _finish(candidate: _Candidate, data: _Data, record: Dataset, steps: Steps) -> LatentModel | None:
    """Estimate on all blocks and return the model of the record."""
    fit = candidate.fit
    final = StateSpaceFit(fit.theta, fit.places, fit.codes, data.whole, fit.states)
    final.advance(_ROUNDS[-1][0], lambda: steps.skip("refinement of parameters"))
    if not isfinite(final.mean_square):
        return None
    return _make_model(final, candidate.layout, candidate.units, record)


def _write_in_modes(fit: StateSpaceFit, layout: StateSpaceLayout) -> NDArray[np.float64]:
    """Return the parameters with one or two states for each mode, of the standard deviation 1."""
    theta, slices = fit.theta.copy(), layout.find_slices()
    order = layout.order
    found = find_modal_form(theta[slices["A"]].reshape(order, order))
    if found is None:
        return theta
    blocks, forward = found
    modal = _transform(theta, layout, forward)
    modal[slices["A"]] = blocks.ravel()
    start = np.linalg.solve(forward, fit.states[0])
    scales = measure_deviations(modal, fit.codes, layout, fit.segments[0].u, start)
    if scales is None:
        return theta
    for state, next_state in pairwise(range(order)):
        if blocks[state, next_state]:  # both states of a pair have one scale
            scales[[state, next_state]] = np.hypot(*scales[[state, next_state]])
    scaled = _transform(modal, layout, np.diag(scales))
    scaled[slices["A"]] = blocks.ravel()
    return scaled if np.isfinite(scaled).all() else theta


def _transform(
    theta: NDArray[np.float64], layout: StateSpaceLayout, forward: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters for the states z of ``x = T z``."""
    found, slices, order = theta.copy(), layout.find_slices(), layout.order
    for name, width in (("A", order), ("B", layout.inputs), ("E", layout.units), ("o", 1)):
        block = theta[slices[name]].reshape(order, width)
        found[slices[name]] = np.linalg.solve(forward, block).ravel()
    found[slices["A"]] = (found[slices["A"]].reshape(order, order) @ forward).ravel()
    found[slices["C"]] = theta[slices["C"]] @ forward
    w = theta[slices["W"]].reshape(layout.units, order + layout.inputs).copy()
    w[:, :order] = w[:, :order] @ forward
    found[slices["W"]] = w.ravel()
    return found


def _make_model(
    fit: StateSpaceFit, layout: StateSpaceLayout, units: tuple[str, ...], record: Dataset
) -> LatentModel:
    """Return the model in the units of a record."""
    theta, slices = _write_in_modes(fit, layout), layout.find_slices()
    mean, scale = record.u.mean(axis=0), _deviation(record.u)
    level, height = float(record.y.mean()), float(_deviation(record.y))
    b = theta[slices["B"]].reshape(layout.order, layout.inputs) / scale
    w = theta[slices["W"]].reshape(layout.units, layout.order + layout.inputs)
    w[:, layout.order :] /= scale
    d = height * theta[slices["D"]] / scale
    theta[slices["o"]] -= b @ mean
    theta[slices["s"]] -= w[:, layout.order :] @ mean
    theta[slices["level"]] = level + height * theta[slices["level"]] - d @ mean
    theta[slices["B"]], theta[slices["W"]], theta[slices["D"]] = b.ravel(), w.ravel(), d
    theta[slices["C"]] *= height
    theta[slices["F"]] *= height
    wiring = tuple(name for name, value in zip(layout.names, theta, strict=True) if value != 0.0)
    radius = float(np.abs(np.linalg.eigvals(theta[slices["A"]].reshape(layout.order, layout.order))).max())
    decay = log(_DECAY) / log(min(max(radius, 1e-3), 1.0 - 1e-6))
    shortest = min(record.segments) * _LARGEST_PART
    # The first sample of a segment lacks its input.
    memory = 1 + round(max(_SAMPLES_PER_STATE * layout.order, min(_LARGEST_MEMORY - 1, decay, shortest)))
    return LatentModel(
        order=layout.order,
        units=units,
        wiring=wiring,
        memory=memory,
        operating_inputs=tuple(mean.tolist()),
        parameters=tuple(value for value in theta.tolist() if value != 0.0),
        input_names=record.input_names,
        output_name=record.output_name,
        dt=record.dt,
        preprocessing=record.preprocessing,
    )
