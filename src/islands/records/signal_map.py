"""Signals of a model: a record as measured, at the rate of the model and as deviations from its offsets."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.records.averaging import average_samples
from islands.records.compatibility import ColumnReference, Reference, match_record
from islands.records.coupled import CoupledRecord, OutputNames, match_coupled
from islands.records.dataset import Dataset, same_dt
from islands.records.preprocessing import reduce_record
from islands.records.preprocessing_steps import Preprocessing


class SampledReference(Protocol):
    """Model of a record, of its filtered or decimated samples, or of means of its samples."""

    @property
    def dt(self) -> float | None:
        """Sampling time in seconds. None if any is allowed."""

    @property
    def average(self) -> int:
        """Number of samples of a mean."""

    @property
    def preprocessing(self) -> Preprocessing | None:
        """Steps before the means, and offsets. None if there were none."""


class SignalReference(Reference, SampledReference, Protocol):
    """Model of one output with the columns of a record."""


def match_rate(model: SampledReference, record: Dataset) -> Dataset:
    """Return a record as measured at the sampling time of a model.

    A record with the sampling time before the preprocessing of the model is filtered and decimated, unless it
    has been preprocessed. Its samples are then averaged if the model describes means of samples, and the
    sampling time of the model is that multiple of the record's. Offsets are not subtracted.

    Raises
    ------
    RecordError
        A recording has fewer samples than a mean, is too short for a filter, or an input is read one sample
        early.
    """
    done = model.preprocessing
    is_measured = record.preprocessing is None
    if done is not None and done.has_rate_steps and is_measured and same_dt(record.dt, done.dt):
        record = reduce_record(record, done)
    averaged = model.average > 1 and model.dt is not None and same_dt(model.dt, record.dt * model.average)
    return average_samples(record, model.average) if averaged else record


class CoupledReference(OutputNames, SampledReference, Protocol):
    """Model of several outputs with the columns of a record."""

    def output_preprocessing(self, place: int) -> Preprocessing | None:
        """Return the preprocessing with the offsets of the inputs and of one output."""


def map_coupled_signals(
    model: CoupledReference, record: CoupledRecord
) -> tuple[CoupledRecord, NDArray[np.float64]]:
    """Return the signals that a model of several outputs reads, and the offset of every output.

    See `map_signals`.
    """
    matched = match_coupled(model, record.map(lambda each: match_rate(model, each)))
    mapped = [
        map_signals(
            ColumnReference(
                *(model.input_names, each.output_name, model.dt, model.average),
                model.output_preprocessing(place),
            ),
            each,
        )
        for place, each in enumerate(matched.records)
    ]
    return CoupledRecord(tuple(each for each, _ in mapped)), np.array([offset for _, offset in mapped])


def map_signals(model: SignalReference, record: Dataset) -> tuple[Dataset, float]:
    """Return the signals that a model reads, and the offset that is added to its output.

    Parameters
    ----------
    model : Model
    record : Dataset
        Record as measured, at any of the two rates, or a preprocessed record.

    Returns
    -------
    record : Dataset
        The record at the rate of the model, with its inputs in the order of the model (see `match_record`),
        less the offsets of the model. The record itself if it is the record of the model.
    offset : float
        Output of the record less that of the model.

    Raises
    ------
    RecordError
        As in `match_rate` and `match_record`.
    """
    record = match_record(model, match_rate(model, record))
    expected, done = model.preprocessing, record.preprocessing
    if expected is None:
        return record, 0.0
    left = expected.relative_to(done) if done else expected
    offset, shift = left.output_offset, np.array(left.input_offsets)
    if offset == 0.0 and not shift.any():
        return record, 0.0
    outputs = record.change_outputs(lambda y: y - offset)
    return replace(record, u=record.u - shift, preprocessing=expected, **outputs), offset
