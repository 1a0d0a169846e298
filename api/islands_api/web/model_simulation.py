"""Simulation of a stored model with inputs of choice: signals, initial output, warnings, and the answer.

It runs in a thread of the API: the model is a document of this project without code, the kernels release the
lock of the interpreter, and the number of samples is bounded.
"""

import gzip
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from islands.errors import ModelError, SettingsError, suggest
from islands.models.coupled_narx import AnyModel, list_models
from islands.models.operating_point import find_equilibrium
from islands.persistence.models import any_model_from_json
from islands.records.coupled import AnyRecord
from islands.records.split import compare_input_ranges
from islands.systems import signals
from islands_api.simulation_schemas import (
    MAX_SAMPLES,
    Hold,
    RecordedInput,
    SimulationRequest,
    Sweep,
    Wave,
)
from islands_service.store.results import StoredModel

#: Samples of a response whose length is not given.
_SAMPLES = 2000

#: Level of the compression of an answer: a higher one takes longer than loopback needs for the difference.
_COMPRESSION = 1

#: Largest number of values that are read of a record.
_MOST_VALUES = 4_000_000

_WAVES: Mapping[str, Callable[[float, float, float, float], signals.Signal]] = {
    "sine": signals.sine,
    "triangle": signals.triangle,
    "steps": signals.steps,
}


@dataclass(frozen=True, slots=True)
class SimulatedModel:
    """Model of a result with the facts about its data that a simulation states.

    Attributes
    ----------
    model : DynamicModel or CoupledModel
    units : tuple of str
        Of the inputs, then of the outputs.
    ranges : tuple of (float, float)
        Range of every input in the estimation data, as measured.
    output_range : float
        Range of the output in the record; the largest one of several.
    """

    model: AnyModel
    units: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    output_range: float

    @property
    def rows(self) -> int:
        """Number of samples of the record that the longest response reads, at most some megabytes."""
        return min(MAX_SAMPLES * self.model.average, _MOST_VALUES // len(self.units))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(each.output_name for each in list_models(self.model))

    @property
    def dt(self) -> float:
        """Sampling time in seconds."""
        return 1.0 if self.model.dt is None else self.model.dt


def read_simulated_model(stored: StoredModel, document: Mapping[str, Any]) -> SimulatedModel:
    """Read a model of a job, whose result is ``document``.

    Raises
    ------
    ModelError
        The model is damaged.
    """
    model = any_model_from_json(stored.file, f"model {stored.rank}")
    units, data = document["record"]["units"], document.get("data", {})
    done = model.preprocessing
    shifts = done.input_offsets if done else (0.0,) * len(model.column_names)
    ranges = tuple(
        (low + shift, high + shift)
        for (low, high), shift in zip(data.get("inputs", {}).get("estimation", ()), shifts, strict=False)
    )
    facts = [each["data"] for each in document["outputs"]] if "outputs" in document else [data]
    output_range = max(float(each.get("output_range") or 0.0) for each in facts)
    of_outputs = units["outputs"] if "outputs" in units else [units["output"]]
    return SimulatedModel(model, (*units["inputs"], *of_outputs), ranges, output_range)


def reads_record(request: SimulationRequest) -> bool:
    """Return whether an input is that of the record."""
    return any(isinstance(each, RecordedInput) for each in request.inputs.values())


def make_inputs(
    found: SimulatedModel, request: SimulationRequest, recorded: AnyRecord | None
) -> tuple[NDArray[np.float64], list[str]]:
    """Return the inputs of a request, and a warning if there are fewer samples than asked for.

    Parameters
    ----------
    recorded : Dataset or CoupledRecord, optional
        Beginning of the record at the rate of the model, if an input is that of the record.

    Returns
    -------
    u : ndarray, shape (samples, inputs)
    warnings : list of str

    Raises
    ------
    SettingsError
        An input is unknown or missing, or overflows; a frequency is too high; or lengths differ.
    """
    names = found.model.column_names
    for name in request.inputs:
        if name not in names:
            raise SettingsError(
                f"the model has no input {name}; it has {', '.join(names)}{suggest(name, names)}"
            )
    samples, warnings = _count_samples(request, recorded)
    with np.errstate(over="ignore", invalid="ignore"):
        columns = [_make_input(found, request, place, samples, recorded) for place in range(len(names))]
    for name, values in zip(names, columns, strict=True):
        if not np.isfinite(values).all():
            raise SettingsError(f"{name} overflows: give smaller numbers")
    return np.column_stack(columns), warnings


def _count_samples(request: SimulationRequest, recorded: AnyRecord | None) -> tuple[int, list[str]]:
    lengths = {name: len(each) for name, each in request.inputs.items() if isinstance(each, list)}
    samples = request.samples or next(iter(lengths.values()), _SAMPLES)
    for name, length in lengths.items():
        if length != samples:
            raise SettingsError(
                f"{name} has {length} numbers, and the response has {samples} samples: give as many numbers "
                "for every input, and leave out samples"
            )
    if reads_record(request) and recorded is not None and recorded.samples < samples:
        return recorded.samples, [f"the record has {recorded.samples} samples, and so has the response"]
    return samples, []


def _make_input(
    found: SimulatedModel,
    request: SimulationRequest,
    place: int,
    samples: int,
    recorded: AnyRecord | None,
) -> NDArray[np.float64]:
    name = found.model.column_names[place]
    given = request.inputs.get(name)
    grid = found.dt, samples * found.dt
    match given:
        case list():
            return np.array(given[:samples], dtype=np.float64)
        case Hold():
            return np.full(samples, given.value)
        case Wave():
            _check_frequency(found, name, given.frequency)
            return given.offset + _WAVES[given.kind](*grid, given.amplitude, given.frequency)
        case Sweep():
            _check_frequency(found, name, max(given.first, given.last))
            return given.offset + signals.sweep(*grid, given.amplitude, given.first, given.last)
        case RecordedInput():
            assert recorded is not None, "the caller has read the record"
            return given.offset + given.scale * recorded.u[:samples, place]
    if not found.ranges:
        raise SettingsError(
            f"the result does not state the range of {name}: give this input, for example "
            f'{{"{name}": {{"kind": "hold", "value": 0}}}}'
        )
    low, high = found.ranges[place]
    return np.full(samples, 0.5 * (low + high))


def _check_frequency(found: SimulatedModel, name: str, frequency: float) -> None:
    most = 0.5 / found.dt
    if frequency > most:
        raise SettingsError(
            f"the frequency of {name} is {frequency:g} Hz: the samples of the model, one in {found.dt:g} s, "
            f"have at most {most:g} Hz"
        )


class Start(NamedTuple):
    """Start of a response.

    Attributes
    ----------
    outputs : tuple of float or None
        Outputs before the first sample; None if the first measured ones are taken, since there are no others.
    is_rest : bool
        Whether the model rests there, with all of its states.
    reason : str
        Reason of the values, the end of a sentence.
    """

    outputs: tuple[float, ...] | None
    is_rest: bool
    reason: str


def find_start(
    found: SimulatedModel, inputs: Sequence[float], given: float | Mapping[str, float] | None
) -> Start:
    """Return the outputs before the first sample, and where they are from.

    Parameters
    ----------
    found : SimulatedModel
    inputs : sequence of float
        First values of the inputs.
    given : float, mapping or None
        Output of the request, or the outputs by column.

    Raises
    ------
    SettingsError
        The outputs of the request are not those of the model.
    """
    if given is not None:
        by_name = given if isinstance(given, Mapping) else dict.fromkeys(found.outputs[:1], given)
        if set(by_name) != set(found.outputs):
            raise SettingsError(
                f"the model has the outputs {', '.join(found.outputs)}: give the initial_output of each by "
                "name, or of none"
            )
        return Start(tuple(by_name[name] for name in found.outputs), False, "as given")
    model: Any = found.model  # each class is a frozen data class, with a hash
    rest, reason = _find_rest(model, tuple(inputs))
    if rest is not None:
        return Start(rest, True, "where the model rests at the first values of the inputs")
    return Start(
        None,
        False,
        f"the first measured value{'s' * (len(found.outputs) > 1)} of the record, since the model has no "
        f"unique equilibrium at the first values of the inputs: {reason}",
    )


# A slider that does not change the first values of the inputs does not change the equilibrium, whose search
# takes longer than the simulation if the model is no polynomial of its output.
@lru_cache(maxsize=256)
def _find_rest(model: AnyModel, inputs: tuple[float, ...]) -> tuple[tuple[float, ...] | None, str]:
    """Return the stable equilibrium at constant inputs, None if there is no unique one, and the reason."""
    try:
        with np.errstate(all="ignore"):
            return tuple(find_equilibrium(model, inputs)), ""
    except ModelError as error:
        return None, str(error).partition(":")[0]


def find_first_outputs(recorded: AnyRecord) -> tuple[float, ...]:
    """Return the first value of every output of the record that is known."""
    return tuple(float(each.y[np.isfinite(each.y)][0]) for each in recorded.records)


def describe_start(found: SimulatedModel, outputs: Sequence[float], reason: str) -> str:
    """State the outputs before the first sample, with their reason."""
    units = found.units[-len(outputs) :]
    values = (
        f"{name} is {value:.6g} {unit}".rstrip()
        for name, value, unit in zip(found.outputs, outputs, units, strict=True)
    )
    return f"before the first sample {' and '.join(values)}, {reason}"


def simulate_inputs(
    found: SimulatedModel,
    u: NDArray[np.float64],
    initial: Sequence[float],
    is_rest: bool,
    start: str,
    warnings: Sequence[str],
) -> dict[str, Any]:
    """Simulate a model; return the fields of `islands_api.simulation_schemas.SimulatedOutput`.

    Parameters
    ----------
    u : ndarray, shape (samples, inputs)
    initial : sequence of float
        Outputs before the first sample.
    is_rest : bool
        Whether the model rests there.
    start : str
        Statement about it.
    warnings : sequence of str
        Warnings about the inputs.
    """
    # Numba takes a second to import, and the API starts without it.
    from islands.simulation.input_response import input_response  # noqa: PLC0415

    model, names, outputs = found.model, found.model.column_names, found.outputs
    response = input_response(model, u, None if is_rest else initial, found.output_range)
    stated = list(warnings)
    if found.ranges:
        measured = list(zip(u.min(axis=0).tolist(), u.max(axis=0).tolist(), strict=True))
        units = found.units[: len(names)]
        stated += compare_input_ranges(names, units, found.ranges, measured, title="this response")
    if not response.outcome:
        stated.append(str(response.outcome))
    y = response.y.reshape(len(response.y), -1)
    return {
        "dt": found.dt,
        "time_s": response.time.tolist(),
        "inputs": {name: values.tolist() for name, values in zip(names, response.u.T, strict=True)},
        "outputs": {name: values.tolist() for name, values in zip(outputs, y.T, strict=True)},
        "initial_outputs": dict(zip(outputs, initial, strict=True)),
        "start": start,
        "outcome": str(response.outcome),
        "warnings": stated,
        "ranges": dict(zip(names, found.ranges, strict=True)) if found.ranges else {},
        "units": dict(zip((*names, *outputs), found.units, strict=True)),
    }


def write_document(document: Mapping[str, Any], compressed: bool) -> bytes:
    """Return a document as JSON in which NaN is null, compressed if the client accepts it.

    The middleware would compress it in the event loop. The serialiser of pydantic takes a twentieth of the
    time of that of Python, and writes the shortest text of a number, too.
    """
    data = to_json(document, inf_nan_mode="null")
    return gzip.compress(data, _COMPRESSION, mtime=0) if compressed else data
