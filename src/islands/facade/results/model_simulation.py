"""`simulate`: simulation of a record, and `predict`: free run of a model on any data, one value per row."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import RecordError, SettingsError, lookup
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.linearisation import EVERYWHERE
from islands.models.protocol import DynamicModel
from islands.records.channel_names import parse_channel_name
from islands.records.compatibility import ColumnReference
from islands.records.coupled import AnyRecord, CoupledRecord, match_coupled
from islands.records.dataset import Dataset, join
from islands.records.reading.column_names import find_column, take_outputs
from islands.records.reading.data_frames import as_dataset, as_record, column_names, states_time
from islands.records.signal_map import match_rate
from islands.records.split import compare_input_ranges, measure_input_ranges
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.input_response import simulate_inputs
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation, map_model_signals, multiple_shooting

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.records.reading.data_frames import RecordLike
    from islands.simulators.specification.table import LocalSpec, SimulationSpec

#: Samples of a shooting interval (case 1 of the paper), unless a setting or a result states another number.
SHOOTING = 500

#: Simulation modes, by the names of the command line.
SIMULATION_MODES = ("one-step", "shooting", "free-run")


def simulate(
    model: "AnyModel | str | Mapping[str, object] | SimulationSpec | LocalSpec",
    record: "RecordLike",
    mode: str = "free-run",
    shooting: int = SHOOTING,
    columns: Mapping[str, NDArray[np.float64]] | None = None,
    warm_up: int | None = None,
    y: "ArrayLike | None" = None,
    states: "ArrayLike | None" = None,
    within: tuple[float, float] = EVERYWHERE,
) -> Simulation:
    """Simulate a record, or inputs alone.

    Parameters
    ----------
    model : DynamicModel, CoupledModel, str, mapping or spec
        A model; or a simulator, as its name on the command line (``second-order``), its specification, or
        the document of an extended simulation.
    record : record, data frame or array
        Inputs, and the outputs from which initial states are taken. Without an output, a model is simulated
        from rest at the first inputs. A list has several recordings. Its samples are averaged if the model
        describes means of samples and the record has the sampling time before averaging (see `match_rate`).
    mode : str
        ``one-step``, ``shooting`` (intervals of ``shooting`` samples) or ``free-run``; a simulator has
        ``free-run`` only.
    shooting : int
        Steps of the model in each interval; a step of a model of means is a mean.
    columns : mapping, optional
        Recorded simulations by name for the simulator ``column:NAME``, each of shape (samples,).
    warm_up : int, optional
        Number of samples before the first prediction of a model; by default the model's largest lag.
    y : float or sequence of float, optional
        Outputs of a model before the first sample, in place of those of the record.
    states : sequence of float, optional
        States of a latent model at the first sample.
    within : (float, float), optional
        Range of the output, as that of the data of a model: the only equilibrium in it is taken of several.

    Raises
    ------
    ModelError
        A model has no unique equilibrium at the first inputs, and there is no output.
    RecordError
        The record does not match the model, or is too short.
    SettingsError
        The mode or the simulator is unknown, or the warm-up is shorter than the model's largest lag.
    """
    intervals = dict(zip(SIMULATION_MODES, (1, shooting, None), strict=True))
    interval = lookup(intervals, mode, "mode")
    if isinstance(model, DynamicModel | CoupledModel):
        data = match_columns(model, record_of_model(model, record))
        if interval is None:
            return run_freely(model, data, warm_up, y, states, within)
        if y is not None or states is not None:
            raise SettingsError("a start is that of a free run: leave out the mode")
        return multiple_shooting(model, data, interval, warm_up)
    if interval is not None:
        raise SettingsError(f"a simulator has no mode {mode!r}: take free-run")
    # Import the simulators of the discrepancy analysis only if they are used.
    from islands.diagnosis.calibration.record_simulation import simulate_spec  # noqa: PLC0415

    single = as_dataset(record)
    y = simulate_spec(model, single, columns)
    return Simulation(y, (float(np.mean((single.y - y) ** 2)),), EvaluationOutcome())


def run_freely(
    model: AnyModel,
    record: AnyRecord,
    warm_up: int | None = None,
    y: "ArrayLike | None" = None,
    states: "ArrayLike | None" = None,
    within: tuple[float, float] = EVERYWHERE,
) -> Simulation:
    """Return the free run of a model: from the measured output, from a given start, or else from rest."""
    if y is None and states is None and np.isfinite(record.y).any():
        return simulate_freely(model, record, warm_up)
    return simulate_inputs(model, record, y, states, within)


def record_of_model(
    model: AnyModel,
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    inputs: str | Sequence[str] = (),
    output: str | Sequence[str] | None = None,
) -> AnyRecord:
    """Return the record of a simulation of a model, as `as_record` makes it, with missing outputs.

    The columns of a frame are those of the model; one without those of some outputs, and an array, have the
    other columns alone. A frame without a time has the sampling time of the model, unless others are given.

    Raises
    ------
    RecordError, SettingsError
        As in `as_record`.
    """
    if not isinstance(model, CoupledModel):
        return _read_output(model, data, y, dt, inputs, output)
    if isinstance(data, Dataset | CoupledRecord) or y is not None:
        return as_record(data, y, dt, inputs=inputs, output=output)
    references = (
        ColumnReference(model.input_names, name, model.dt, model.average) for name in model.output_names
    )
    names = take_outputs(output) or model.output_names
    return CoupledRecord(
        tuple(
            _read_output(each, data, None, dt, inputs, name)
            for each, name in zip(references, names, strict=True)
        )
    )


def match_columns(model: AnyModel, record: AnyRecord) -> AnyRecord:
    """Return a record at the rate of a model, with several outputs in the order of the model.

    Raises
    ------
    RecordError
        The record has other outputs, or is too short for the preprocessing of the model.
    """
    data = record.map(partial(match_rate, model))
    if not isinstance(model, CoupledModel):
        return data
    if isinstance(data, Dataset):
        raise RecordError(
            f"the model has the outputs {', '.join(model.output_names)}, the record {data.output_name}: give "
            "a record of all of them, as by as_record(frame, inputs=[...], output=[...])"
        )
    # A simulation of inputs alone reads them as measured, and advances them itself.
    is_advanced = set(data.input_names) == set(model.input_names)
    return match_coupled(model, data, None if is_advanced else model.column_names)


def split_start(model: AnyModel, start: Mapping[str, float]) -> tuple[list[float] | None, list[float] | None]:
    """Return the outputs and the states of a start by name; None for those that are not given.

    Raises
    ------
    SettingsError
        A name is neither an output nor a state of the model.
    """
    block = model.block()
    computed = block.columns[: block.computed]
    if unknown := start.keys() - set(computed):
        raise SettingsError(f"the start of {', '.join(sorted(unknown))}: the model has {', '.join(computed)}")
    y, states = (
        [start[name] for name in names if name in start] or None
        for names in (computed[: block.outputs], computed[block.outputs :])
    )
    return y, states


def list_extrapolations(
    model: AnyModel, record: AnyRecord, estimated: Sequence[Sequence[float]]
) -> list[str]:
    """State the inputs of a record that leave the range of the estimation data of a model.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : record
        At the rate of the model.
    estimated : sequence of (float, float)
        Range of every input of the model in its estimation data.
    """
    (signals, *_) = map_model_signals(model, record)[0].records
    found = measure_input_ranges(signals)
    names, units = signals.input_names, signals.input_units
    return compare_input_ranges(names, units, estimated, found, title="the record")


def _read_output(
    model: DynamicModel | ColumnReference,
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None",
    dt: float | None,
    inputs: str | Sequence[str],
    output: str | Sequence[str] | None,
) -> Dataset:
    """Return the record of a model of one output, or of one output of several."""
    if isinstance(data, Dataset | CoupledRecord):
        return as_dataset(data, y, dt, inputs=inputs, output=output)
    if isinstance(data, list | tuple) and y is None and not np.isscalar(data[0]):
        return join(tuple(_read_output(model, each, None, dt, inputs, output) for each in data))
    output = next(iter(take_outputs(output)), None)
    if y is None:
        inputs, output = inputs or _name_columns(model), output or model.output_name
    known = column_names(data)
    if y is None and not known:
        u = np.asarray(data, dtype=np.float64)
        step = (model.dt or 1.0) / model.average if dt is None else dt
        return Dataset(u, np.full(len(u), np.nan), step, _name_columns(model), model.output_name)
    if y is None and output and find_column(output, known) not in known:
        output = None
    if dt is None and model.dt is not None and not states_time(data, (*inputs, output or "")):
        dt = model.dt / model.average
    record = as_dataset(data, y, dt, inputs=inputs, output=output, missing_output=True)
    return record if y is not None or output else replace(record, output_name=model.output_name)


def _name_columns(model: "DynamicModel | ColumnReference") -> tuple[str, ...]:
    return tuple(parse_channel_name(name).base for name in model.input_names)


def predict(model: AnyModel, record: AnyRecord, warm_up: int | None = None) -> NDArray[np.float64]:
    """Return the free run of a model with one value of each output for every sample of a record.

    Each sample of a model of means has the prediction of its mean. Behind a decimation, a prediction is held
    until the next sample of the model.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
        Inputs, and the first samples of the outputs.
    warm_up : int, optional
        Number of steps of the model before the first prediction; by default the model's largest lag.

    Returns
    -------
    ndarray, shape (samples,) or (samples, outputs)
        NaN during the warm-up of every segment and after a divergence.

    Raises
    ------
    RecordError
        The record does not match the model, is too short, or its output is missing in the warm-up.
    """
    data = match_columns(model, record)
    found = run_freely(model, data, model.maximum_lag if warm_up is None else warm_up).y
    if data.samples == record.samples:
        return found
    predicted = np.full((record.samples, *found.shape[1:]), np.nan)
    every = round(data.dt / record.dt)
    for (begin, end), (first, last) in zip(record.bounds, data.bounds, strict=True):
        held = np.repeat(found[first:last], every, axis=0)[: end - begin]
        predicted[begin : begin + len(held)] = held
    return predicted
