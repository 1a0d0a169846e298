"""Samples of a record without a measured output."""

from dataclasses import replace

import numpy as np

from islands.errors import RecordError
from islands.records.dataset import Dataset


def skip_missing_outputs(record: Dataset) -> Dataset:
    """Return a record without the samples whose output is missing.

    The parts before and after them are segments of the same recording, so that no regressor reads a missing
    value and every simulation is started again after it.

    Parameters
    ----------
    record : Dataset

    Returns
    -------
    Dataset
        The record itself if no output is missing.

    Raises
    ------
    RecordError
        Every output is missing.
    """
    known = ~np.isnan(record.y)
    if known.all():
        return record
    if not known.any():
        raise RecordError(f"{record.output_name} is missing in every sample: choose another output")
    lengths, names = [], []
    for name, (begin, end) in zip(record.recordings, record.bounds, strict=True):
        # Runs of known samples start and end where the padded indicator changes.
        edges = np.flatnonzero(np.diff(np.concatenate([[0], known[begin:end], [0]])))
        lengths += [int(length) for length in edges[1::2] - edges[::2]]
        names += [name] * (len(edges) // 2)
    return replace(
        record,
        u=record.u[known],
        y=record.y[known],
        segments=tuple(lengths),
        recordings=tuple(names),
        held_out=0,
        start=record.start + int(np.argmax(known)) * record.dt,
        measured=None,
    )
