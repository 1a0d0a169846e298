"""Linear model of a record as a latent model without units, which every use of a model takes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf, isfinite, log, nan

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.linear.identify import identify_orders
from islands.estimation.linear.model import LinearModel
from islands.estimation.linear.sections import Signal
from islands.estimation.modal_form import find_modal_form
from islands.estimation.model_cache import share_models
from islands.kernels.state_space import simulate_states
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.models.state_space import Quantity
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset

#: Samples for each state, samples, and part of the shortest recording that give initial states.
_SAMPLES_PER_STATE, _LARGEST_MEMORY, _LARGEST_PART = 3, 100, 0.05

#: Part to which a mode decays in these samples.
_DECAY = 0.01


def identify_linear_model(record: Dataset, steps: Steps | None = None) -> LatentModel:
    """Identify the linear model of a record; see `identify_linear`.

    Parameters
    ----------
    record : Dataset
        Record without missing values. An output reads the inputs that are read one sample early at sample k.
    steps : Steps, optional
        Receives the orders that are fitted, and may stop.

    Returns
    -------
    LatentModel
        Its quantities have the standard errors of the identification.

    Raises
    ------
    RecordError
        The record is too short, or its best linear model is a static gain within the sample and its inputs
        are not read early.
    StoppedError
        A stop is requested.
    """
    return identify_linear_models(record, steps)[0]


@share_models
def identify_linear_models(record: Dataset, steps: Steps | None = None) -> list[LatentModel]:
    """Identify the linear model of a record, and the best ones of other orders after it.

    Parameters and errors are those of `identify_linear_model`.
    """
    return [model for (model,) in _identify([record], steps)]


def identify_joint_model(record: CoupledRecord, steps: Steps | None = None) -> CoupledLatentModel:
    """Identify a linear model whose outputs share the poles; see `identify_linear_model`."""
    return CoupledLatentModel(next(_identify(record.records, steps)))


def _identify(records: Sequence[Dataset], steps: Steps | None) -> Iterator[tuple[LatentModel, ...]]:
    """Yield the models of all outputs of records that share the inputs: the best ones, then other orders."""
    record = records[0]
    early = [int(parse_channel_name(name).at_once) for name in record.input_names]
    late = max(early)
    rows = [np.arange(begin + late, end) for begin, end in record.bounds if end - begin > late]
    kept = np.concatenate(rows)
    u = np.column_stack([record.u[kept - lead, place] for place, lead in enumerate(early)])
    lengths = [each.size for each in rows]
    y = np.column_stack([each.y[kept] for each in records])
    orders = identify_orders(u, y, record.dt, lengths, feedthrough=all(early), steps=steps)
    for place, found in enumerate(orders):
        if found.d[found.delays + early == 0].any():
            if not place:
                raise RecordError(
                    "the output follows the input within a sample: read the inputs one sample early"
                )
            continue
        yield tuple(make_latent_model(found, each, u, output) for output, each in enumerate(records))


def make_latent_model(found: LinearModel, record: Dataset, u: Signal, output: int = 0) -> LatentModel:
    """Return the linear model of an output with states of the standard deviation 1.

    Parameters
    ----------
    found : LinearModel
    record : Dataset
        Record of the output with the columns and the recordings of the model.
    u : ndarray, shape (rows, inputs)
        Inputs of the record.
    output : int
    """
    layout = StateSpaceLayout(found.order, u.shape[1], 0)
    modal = find_modal_form(found.a) if found.order else None
    a, forward = modal or (found.a, np.eye(found.order))
    b, drift = (np.linalg.solve(forward, each) for each in (found.b[output], found.drift[output]))
    c, d, level = found.c @ forward, found.d[output], float(found.y0[output])
    if found.drift[output].any():
        drift = drift - b @ found.u0
    else:
        level -= float(c @ np.linalg.solve(np.eye(found.order) - a, b @ found.u0))
    level -= float(d @ found.u0)
    units = _measure_states(a, b, u - found.u0)
    a, b, c, drift = a * units / units[:, None], b / units[:, None], c * units, drift / units
    theta = np.concatenate([a.ravel(), b.ravel(), c, d, drift, [level]])
    named = [(name, value) for name, value in zip(layout.names, theta.tolist(), strict=True) if value]
    early = [parse_channel_name(name).at_once for name in record.input_names]
    model = LatentModel(
        order=found.order,
        wiring=tuple(name for name, _ in named),
        memory=_choose_memory(found.poles, record) + int(max(found.delays[output] + early)),
        operating_inputs=tuple(found.u0.tolist()),
        delays=tuple(found.delays[output].tolist()),
        parameters=tuple(value for _, value in named),
        input_names=record.input_names,
        output_name=record.output_name,
        dt=record.dt,
        preprocessing=record.preprocessing,
    )
    return replace(model, quantity_errors=_match_errors(model.quantities, found, output))


def _measure_states(a: Signal, b: Signal, u: Signal) -> Signal:
    """Return the standard deviation of each state, 1 of one that does not move; a pair has one."""
    order = len(a)
    # A simulation ends at large states, so that their unit must not be that of the output.
    unit = float((np.abs(b) @ np.abs(u).max(axis=0)).max(initial=0.0)) or 1.0
    theta = np.concatenate([a.ravel(), (b / unit).ravel(), np.zeros(2 * order + u.shape[1] + 1)])
    states = np.empty((len(u), order))
    rows = simulate_states(theta, np.zeros(0, np.int64), np.ascontiguousarray(u), np.zeros(order), states)
    found = unit * states[:rows].std(axis=0)
    for place in np.flatnonzero(np.diagonal(a, 1)):
        found[place : place + 2] = np.hypot(*found[place : place + 2])
    return np.where(found > 0.0, found, 1.0)


def _choose_memory(poles: NDArray[np.complex128], record: Dataset) -> int:
    """Return the number of samples from which initial states are estimated."""
    radius = float(np.abs(poles).max(initial=0.0))
    decay = log(_DECAY) / log(min(max(radius, 1e-3), 1.0 - 1e-6))
    shortest = min(record.segments) * _LARGEST_PART
    return 1 + round(max(_SAMPLES_PER_STATE * len(poles), min(_LARGEST_MEMORY - 1, decay, shortest)))


def _match_errors(quantities: tuple[Quantity, ...], found: LinearModel, output: int) -> tuple[float, ...]:
    """Return the standard error of each quantity of a model: that of the nearest one of the same kind."""
    left = list(zip(found.quantities[output], found.errors[output], strict=True))
    errors: list[float] = []
    for each in quantities:
        distances = [
            abs(other.value - each.value) if (other.name, other.input) == (each.name, each.input) else inf
            for other, _ in left
        ]
        nearest = min(range(len(left)), key=distances.__getitem__, default=0)
        is_known = bool(left) and isfinite(distances[nearest])
        error = float(left.pop(nearest)[1]) if is_known else nan
        # A dead time of whole samples is chosen, not estimated; that of a fraction is another quantity.
        errors.append(nan if each.name == "dead time" else error)
    return tuple(errors)
