"""Samples of data sets for plots: columns are read once, and the latest are kept in memory."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.table import select
from islands_api.web.dependencies import AppState
from islands_api.web.uploads.dataset_storage import open_stored
from islands_service.domain.plot_envelopes import describe_envelopes
from islands_service.intake.sample_reading import read_columns
from islands_service.store.datasets import StoredDataset


async def get_columns(
    state: AppState, owner: str, stored: StoredDataset, names: Sequence[str]
) -> NDArray[np.float64]:
    """Return whole columns of a data set, shape (columns, samples), from memory if they were read before.

    Raises
    ------
    RecordError, BlobNotFoundError, ObjectStoreError, StorageFullError
    """
    # How numbers are written is inferred from all columns that are read together.
    key = owner, stored.id, tuple(names)
    columns = state.plotted_columns.get(key)
    if columns is None:
        settings, reading = state.settings, stored.preview.get("reading", {})
        limits = settings.inspection_memory, settings.inspection_seconds
        async with open_stored(state, owner, stored) as path:
            columns = await state.run_blocking(read_columns, path, names, reading, *limits)
        state.plotted_columns.store(key, columns)
    return columns


def describe_rows(
    columns: NDArray[np.float64], names: Sequence[str], file: str, rows: slice, points: int
) -> dict[str, Any]:
    """Return the envelopes of rows of columns, with the fields of `islands_api.dataset_schemas.Samples`.

    Raises
    ------
    RecordError
        The file has no such rows.
    """
    chosen = select(rows, columns.shape[1], file)
    signals = dict(zip(names, columns[:, chosen.start : chosen.stop], strict=True))
    first, envelopes = describe_envelopes(signals, chosen.start, points)
    return {"start": chosen.start, "stop": chosen.stop, "rows": first, "columns": envelopes}
