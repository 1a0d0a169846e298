"""Envelopes of signals as documents, for plots with fewer points than the signals have samples.

The outputs of a diagnosis are an artefact of its job: a NumPy file of records, one for each sample, whose
fields name the outputs. It is mapped into memory, so that a part of a long record is read without the rest.
"""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.records.envelope import find_envelope

#: Name of the measured output.
MEASURED = "measured"


def describe_envelopes(
    signals: Mapping[str, NDArray[np.float64]], start: int, points: int
) -> tuple[list[int], list[dict[str, Any]]]:
    """Return the first rows of the parts of signals, and the extremes of the signals in them, as JSON.

    Parameters
    ----------
    signals : mapping of str to ndarray, shape (samples,)
        Signals of the same rows.
    start : int
        First row.
    points : int
        Largest number of parts.

    Returns
    -------
    rows : list of int
    columns : list of dict
        Fields of `islands_api.schemas.Envelope`.
    """
    columns, first = [], np.empty(0, np.int64)
    for name, values in signals.items():
        least, greatest, first = find_envelope(values, points)
        columns.append({"name": name, "minimum": _to_list(least), "maximum": _to_list(greatest)})
    return (first + start).tolist(), columns


def _to_list(values: NDArray[np.float64]) -> list[float | None]:
    """Return values as JSON has them: None for missing and infinite ones."""
    return [
        value if known else None for value, known in zip(values.tolist(), np.isfinite(values), strict=True)
    ]


def write_outputs(measured: NDArray[np.float64], simulated: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return the bytes of the artefact.

    Parameters
    ----------
    measured : ndarray, shape (samples,)
        Missing samples are NaN.
    simulated : mapping of str to ndarray, shape (samples,)
        Simulated outputs by name.
    """
    columns = {MEASURED: measured, **simulated}
    records = np.empty(measured.size, [(name, "<f8") for name in columns])
    for name, values in columns.items():
        records[name] = values
    stream = BytesIO()
    np.save(stream, records)
    return stream.getvalue()


def describe_outputs(path: Path, start: int, stop: int | None, points: int) -> dict[str, Any]:
    """Return the envelopes of outputs and residuals.

    Parameters
    ----------
    path : Path
        File with the bytes of `write_outputs`.
    start, stop : int, int or None
        First sample, from 0, and the sample after the last one; None is the end.
    points : int
        Largest number of parts.

    Returns
    -------
    dict
        Fields of `islands_api.result_schemas.DiagnosisOutputs`.

    Raises
    ------
    SettingsError
        There are no such samples.
    """
    stored = np.load(path, mmap_mode="r", allow_pickle=False)
    end = stored.size if stop is None else min(stop, stored.size)
    if start >= end:
        raise SettingsError(
            f"the record has samples 0 to {stored.size - 1}, and {start}:{'' if stop is None else stop} "
            "is not a part of it: correct start and stop"
        )
    part = stored[start:end]
    outputs = {name: np.ascontiguousarray(part[name]) for name in stored.dtype.names}
    residuals = {name: outputs[MEASURED] - output for name, output in outputs.items() if name != MEASURED}
    rows, described = describe_envelopes(outputs, start, points)
    return {
        "start": start,
        "stop": end,
        "rows": rows,
        "outputs": described,
        "residuals": describe_envelopes(residuals, start, points)[1],
    }
