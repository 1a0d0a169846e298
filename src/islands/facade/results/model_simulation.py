"""`simulate`: simulation of a record, and `predict`: free run of a model on any data, one value per row."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError, lookup
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.protocol import DynamicModel
from islands.records.channel_names import parse_channel_name
from islands.records.compatibility import ColumnReference
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset, join
from islands.records.reading.column_names import find_column
from islands.records.reading.data_frames import as_record, column_names, states_time
from islands.records.signal_map import match_rate
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.input_response import simulate_inputs
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation, multiple_shooting

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.records.reading.data_frames import RecordLike
    from islands.simulators.specification.table import LocalSpec, SimulationSpec

#: Samples of a shooting interval (case 1 of the paper), unless a setting or a result states another number.
SHOOTING = 500

#: Simulation modes, by the names of the command line.
SIMULATION_MODES = ("one-step", "shooting", "free-run")


def simulate(
    model: "DynamicModel | str | Mapping[str, object] | SimulationSpec | LocalSpec",
    record: "RecordLike",
    mode: str = "free-run",
    shooting: int = SHOOTING,
    columns: Mapping[str, NDArray[np.float64]] | None = None,
    warm_up: int | None = None,
    y: "ArrayLike | None" = None,
    states: "ArrayLike | None" = None,
) -> Simulation:
    """Simulate a record, or inputs alone.

    Parameters
    ----------
    model : DynamicModel, str, mapping or spec
        A model; or a simulator, as its name on the command line (``second-order``), its specification, or
        the document of an extended simulation.
    record : Dataset, data frame or array
        Inputs, and the output from which initial states are taken. Without an output, a model is simulated
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
    y : float, optional
        Output of a model before the first sample, in place of that of the record.
    states : sequence of float, optional
        States of a latent model at the first sample.

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
    if isinstance(model, DynamicModel):
        record = record_of_model(model, record)
        record = match_rate(model, record)
        if interval is None:
            return run_freely(model, record, warm_up, y, states)
        if y is not None or states is not None:
            raise SettingsError("a start is that of a free run: leave out the mode")
        return multiple_shooting(model, record, interval, warm_up)
    if interval is not None:
        raise SettingsError(f"a simulator has no mode {mode!r}: take free-run")
    # Import the simulators of the discrepancy analysis only if they are used.
    from islands.diagnosis.calibration.record_simulation import simulate_spec  # noqa: PLC0415

    record = as_record(record)
    y = simulate_spec(model, record, columns)
    return Simulation(y, (float(np.mean((record.y - y) ** 2)),), EvaluationOutcome())


def run_freely(
    model: AnyModel,
    record: AnyRecord,
    warm_up: int | None = None,
    y: "ArrayLike | None" = None,
    states: "ArrayLike | None" = None,
) -> Simulation:
    """Return the free run of a model: from the measured output, from a given start, or else from rest."""
    if y is None and states is None and np.isfinite(record.y).any():
        return simulate_freely(model, record, warm_up)
    return simulate_inputs(model, record, y, states)


def record_of_model(
    model: DynamicModel | ColumnReference,
    data: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
) -> Dataset:
    """Return the record of a simulation of a model, as `as_record` makes it, with missing outputs.

    The columns of a frame are those of the model; one without that of the output, and an array, have inputs
    alone. A frame without a time has the sampling time of the
    model, unless others are given.

    Raises
    ------
    RecordError, SettingsError
        As in `as_record`.
    """
    if isinstance(data, Dataset):
        return as_record(data, y, dt, inputs=inputs, output=output)
    if isinstance(data, list | tuple) and y is None and not np.isscalar(data[0]):
        return join(tuple(record_of_model(model, each, None, dt, inputs, output) for each in data))
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
    record = as_record(data, y, dt, inputs=inputs, output=output, missing_output=True)
    return record if y is not None or output else replace(record, output_name=model.output_name)


def _name_columns(model: "DynamicModel | ColumnReference") -> tuple[str, ...]:
    return tuple(parse_channel_name(name).base for name in model.input_names)


def coupled_record_of_model(model: CoupledModel, data: "RecordLike | CoupledRecord") -> CoupledRecord:
    """Return the record of a model of several outputs, of which a frame may lack some or all outputs.

    Raises
    ------
    RecordError, SettingsError
        As in `as_record`.
    """
    if isinstance(data, CoupledRecord):
        return data
    references = (
        ColumnReference(model.input_names, name, model.dt, model.average) for name in model.output_names
    )
    return CoupledRecord(tuple(record_of_model(each, data) for each in references))


def predict(model: DynamicModel, record: Dataset, warm_up: int | None = None) -> NDArray[np.float64]:
    """Return the free run of a model with one value for every sample of a record.

    Each sample of a model of means has the prediction of its mean. Behind a decimation, a prediction is held
    until the next sample of the model.

    Parameters
    ----------
    model : DynamicModel
    record : Dataset
        Inputs, and the first samples of the output.
    warm_up : int, optional
        Number of steps of the model before the first prediction; by default the model's largest lag.

    Returns
    -------
    ndarray, shape (samples,)
        NaN during the warm-up of every segment and after a divergence.

    Raises
    ------
    RecordError
        The record does not match the model, is too short, or its output is missing in the warm-up.
    """
    data = match_rate(model, record)
    return hold_predictions(record, data, run_freely(model, data, warm_up).y)


def hold_predictions(
    record: AnyRecord, data: AnyRecord, simulated: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a simulation at the rate of a model with one value for every sample as measured."""
    if data is record:
        return simulated
    predicted = np.full((record.samples, *simulated.shape[1:]), np.nan)
    every = round(data.dt / record.dt)
    for (begin, end), (first, last) in zip(record.bounds, data.bounds, strict=True):
        held = np.repeat(simulated[first:last], every, axis=0)[: end - begin]
        predicted[begin : begin + len(held)] = held
    return predicted
