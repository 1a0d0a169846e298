"""Preprocessing of records: low-pass filter, decimation, removal of offsets and of a trend.

Filters run forward and backward (Butterworth), so they do not shift a signal in time. All signals have the
same filter: for a linear system, the filtered output is the response to the filtered inputs. A zero-phase
filter also reads samples that follow, over about one period of its cutoff.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError, check_type
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset, same_dt
from islands.records.preprocessing_steps import Preprocessing, PreprocessingSteps, find_decimation_cutoff

#: Orders of the low-pass filter and of the filter before a decimation, which run twice.
_LOWPASS_ORDER, _DECIMATION_ORDER = 2, 4

#: Samples of a segment for every order of a filter, at least.
_SAMPLES_PER_ORDER = 6


def preprocess(
    record: Dataset,
    *,
    lowpass: float | None = None,
    decimate: int = 1,
    detrend: str = "none",
    like: Dataset | None = None,
) -> Dataset:
    """Filter, decimate and detrend a record, in this order.

    Parameters
    ----------
    record : Dataset
        A record that has not been preprocessed.
    lowpass : float, optional
        Cutoff in hertz of a zero-phase low-pass filter. Inputs and output have the same filter.
    decimate : int
        Keep one of this number of samples, behind a zero-phase low-pass filter. The sampling time is
        multiplied by it.
    detrend : str
        ``constant`` subtracts the mean of every signal, ``linear`` also a straight line from the output, for
        a sensor that drifts.
    like : Dataset, optional
        Preprocessed record of the same system, such as the estimation data, whose steps and offsets are
        applied in place of those above. Its line is not subtracted: the drift of one record is not that of
        another.

    Returns
    -------
    Dataset
        Its attribute ``preprocessing`` states what was done. The record itself if there is no step.

    Raises
    ------
    SettingsError
        A value is out of range, or the record has several outputs.
    RecordError
        The record has been preprocessed before, has segments that are too short for a filter, or several
        segments and a linear trend; or its sampling time differs from that of ``like``.
    """
    advice = "make one by as_record(data, inputs=..., output=...); of several outputs, take record.map(...)"
    check_type(record, Dataset, "preprocess", advice)
    if like is not None:
        return record if like.preprocessing is None else apply_preprocessing(record, like.preprocessing)
    steps = PreprocessingSteps(lowpass, decimate, detrend)
    if steps.is_none:
        return record
    if record.preprocessing is not None:
        raise RecordError("the record has been preprocessed before: give the record as measured")
    reduced = _reduce(record, steps)
    if detrend == "none":
        found = Preprocessing(steps, record.dt, (0.0,) * record.inputs, 0.0, 0.0)
        return replace(reduced, preprocessing=found)
    if detrend == "linear" and len(record.segments) > 1:
        raise RecordError(
            f"a linear trend needs one recording without gaps, this record has {len(record.segments)} "
            "segments: take detrend constant"
        )
    slope = _fit_slope(reduced) if detrend == "linear" else 0.0
    time = reduced.dt * np.arange(reduced.samples)
    straight = replace(reduced, **reduced.change_outputs(lambda y: y - slope * (time - time.mean())))
    known = straight.y[np.isfinite(straight.y)]
    offsets = tuple(float(signal.mean()) for signal in reduced.u.T)
    found = Preprocessing(steps, record.dt, offsets, float(known.mean()) if known.size else 0.0, slope)
    return _subtract(straight, found)


def apply_preprocessing(record: Dataset, preprocessing: Preprocessing) -> Dataset:
    """Do the steps of another record of the same system, with its offsets and without its line.

    Raises
    ------
    RecordError
        The sampling time or the number of inputs differs, or a segment is too short for a filter.
    """
    if not same_dt(record.dt, preprocessing.dt):
        raise RecordError(
            f"the model was identified from a record with a sampling time of {preprocessing.dt:.10g} s, this "
            f"one has {record.dt:.10g} s: resample it"
        )
    if record.inputs != len(preprocessing.input_offsets):
        raise RecordError(
            f"the preprocessed record has {len(preprocessing.input_offsets)} inputs, this one "
            f"{record.inputs}: give the same inputs"
        )
    return _subtract(_reduce(record, preprocessing.steps), preprocessing)


def reduce_record(record: Dataset, preprocessing: Preprocessing) -> Dataset:
    """Filter and decimate a record as another one of the same system, without its offsets.

    Inputs that are read one sample early are advanced afterwards (see `match_record`): the record has them as
    measured.

    Raises
    ------
    RecordError
        A segment is too short for a filter, or an input of the record is read one sample early.
    """
    done = Preprocessing(
        preprocessing.without_offsets.steps, preprocessing.dt, (0.0,) * record.inputs, 0.0, 0.0
    )
    return replace(_reduce(record, preprocessing.steps), preprocessing=done)


def _subtract(record: Dataset, found: Preprocessing) -> Dataset:
    return replace(
        record,
        u=record.u - np.array(found.input_offsets),
        **record.change_outputs(lambda y: y - found.output_offset),
        preprocessing=found,
    )


def _reduce(record: Dataset, steps: PreprocessingSteps) -> Dataset:
    """Return the filtered and decimated record."""
    early = [name for name in record.input_names if parse_channel_name(name).at_once]
    if early and steps.has_rate_steps:
        # A model of such an input filters a measured record and advances it afterwards, see `match_rate`.
        raise RecordError(
            f"{early[0]} is read one sample early, so it cannot be filtered or decimated: read "
            f"{parse_channel_name(early[0]).base}, and fit the record with feedthrough yes"
        )
    if steps.lowpass is not None:
        if steps.lowpass >= 0.5 / record.dt:
            raise SettingsError(
                f"lowpass is below half the sampling rate, {0.5 / record.dt:.6g} Hz, got {steps.lowpass:g}"
            )
        record = _filter(record, steps.lowpass, _LOWPASS_ORDER)
    if steps.decimate == 1:
        return record
    record = _filter(record, find_decimation_cutoff(record.dt, steps.decimate), _DECIMATION_ORDER)
    kept = np.concatenate([np.arange(begin, end, steps.decimate) for begin, end in record.bounds])
    return replace(
        record,
        u=record.u[kept],
        **record.change_outputs(lambda y: y[kept]),
        dt=record.dt * steps.decimate,
        segments=tuple(-(-length // steps.decimate) for length in record.segments),
    )


def _filter(record: Dataset, cutoff: float, order: int) -> Dataset:
    """Apply a zero-phase low-pass filter to every signal of every segment."""
    # The import takes half a second, and every model file names its preprocessing.
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415

    if min(record.segments) <= _SAMPLES_PER_ORDER * order:
        raise RecordError(
            f"a segment of {min(record.segments)} samples is too short for a filter: give longer recordings"
        )
    sections = butter(order, cutoff, fs=1.0 / record.dt, output="sos")
    filter_one = partial(_filter_signal, record=record, filter_part=partial(sosfiltfilt, sections))
    u = np.column_stack([filter_one(signal) for signal in record.u.T])
    return replace(record, u=u, **record.change_outputs(filter_one))


def _filter_signal(
    signal: NDArray[np.float64],
    record: Dataset,
    filter_part: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    known = np.isfinite(signal)
    if not known.any():
        return signal
    places = np.arange(signal.size)
    # Missing outputs are interpolated for the filter and missing again behind it.
    filled = signal if known.all() else np.interp(places, places[known], signal[known])
    parts = [filter_part(filled[begin:end]) for begin, end in record.bounds]
    return np.where(known, np.concatenate(parts), np.nan)


def _fit_slope(record: Dataset) -> float:
    """Return the slope of the output, per second, by least squares."""
    known = np.isfinite(record.y)
    time = record.dt * np.arange(record.samples)[known]
    centred = time - time.mean()
    power = float(np.sum(centred**2))
    return float(np.sum(centred * record.y[known])) / power if power > 0.0 else 0.0
