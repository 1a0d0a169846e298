"""Admission of the channels of a record: constant ones and copies of the input or the output are left out.

A copy of the output explains any misfit as coupling, and a copy of the input any error of a gain.
"""

from collections.abc import Set
from dataclasses import replace

import numpy as np

from islands.diagnosis.gross_errors.record_finding import RecordFinding
from islands.effects.interface.context import Signal
from islands.records.channel_names import TEMPERATURES
from islands.records.dataset import Dataset

#: Largest RMS difference between a channel and a scaled copy of another signal, relative to the standard
#: deviation of the channel, for which it counts as a copy. Two sensors of one signal differ by their noise.
MAX_DIFFERENCE = 0.02

#: The same for a temperature, which the output may follow closely, and which may rise as the input does.
MAX_DIFFERENCE_OF_TEMPERATURE = 1e-6

#: Largest delay between a channel and the signal that it is a copy of, in samples.
MAX_LAG = 2


def admit_channels(
    record: Dataset, fitted: int, read: Set[str] = frozenset()
) -> tuple[Dataset, tuple[RecordFinding, ...]]:
    """Return a record without the channels that cannot be a cause, and a finding for each of these.

    Channels that the simulation reads remain.

    Parameters
    ----------
    record : Dataset
        The first input drives the simulation; further inputs are channels.
    fitted : int
        Number of samples used for estimation.
    read : set of str
        Names of the channels that the simulation reads.
    """
    kept, findings, estimation = [0], [], record[:fitted]
    for place in range(1, record.inputs):
        is_read = record.input_names[place] in read
        finding = None if is_read else _examine_channel(estimation, place)
        if finding is None:
            kept.append(place)
        else:
            findings.append(finding)
    if not findings:
        return record, ()
    return (
        replace(
            record,
            u=record.u[:, kept],
            input_names=tuple(record.input_names[place] for place in kept),
            input_units=tuple(record.input_units[place] for place in kept),
        ),
        tuple(findings),
    )


def _examine_channel(record: Dataset, place: int) -> RecordFinding | None:
    """Return the reason to leave a channel out of the estimation part of a record, or None."""
    name, channel = record.input_names[place], record.u[:, place]
    if np.ptp(channel) == 0.0:
        return RecordFinding(
            "constant-channel",
            f"Channel {name} is constant over the samples used for estimation; it was left out.",
            f"Leave {name} out, or select rows in which it varies.",
        )
    is_thermal = record.input_units[place] in TEMPERATURES
    allowed = MAX_DIFFERENCE_OF_TEMPERATURE if is_thermal else MAX_DIFFERENCE
    difference, factor, original = min(
        (*_fit_copy(channel, record.y), record.output_name),
        (*_fit_copy(channel, record.u[:, 0]), record.input_names[0]),
    )
    if difference > allowed:
        return None
    return RecordFinding(
        "duplicated-channel",
        f"Channel {name} is a copy of {original}, scaled by {factor:.4g}: the RMS difference is "
        f"{100 * difference:.2g} % of the channel's standard deviation. A copy explains errors that it does "
        "not cause; it was left out.",
        f"Leave {name} out, or select the column of another signal.",
        {"factor": (factor, ""), "difference": (difference, "")},
    )


def _fit_copy(channel: Signal, signal: Signal) -> tuple[float, float]:
    """Return the relative RMS difference that remains, and the factor from a signal to a channel.

    The least difference over delays up to `MAX_LAG` samples counts. Missing samples do not count.
    """
    fits = []
    for lag in range(-MAX_LAG, MAX_LAG + 1):
        copy = channel[max(lag, 0) : channel.size + min(lag, 0)]
        original = signal[max(-lag, 0) : signal.size + min(-lag, 0)]
        is_known = ~np.isnan(original)
        copy, original = copy[is_known], original[is_known]
        if not copy.size or np.ptp(original) == 0.0 or np.ptp(copy) == 0.0:
            continue
        copy, original = copy - copy.mean(), original - original.mean()
        factor = float(copy @ original) / float(original @ original)
        difference = float(np.sqrt(np.mean((copy - factor * original) ** 2) / np.mean(copy**2)))
        fits.append((difference, factor))
    return min(fits, default=(np.inf, 0.0))
