"""Recordings in the body of a job: a data set, or a range of its rows."""

from collections.abc import Mapping
from typing import Any

from islands_api.dataset_schemas import DatasetSummary, DatasetView


def make_part(
    given: DatasetView | DatasetSummary | str | Mapping[str, Any], rows: str | None = None
) -> Mapping[str, Any]:
    """Return a recording in the form of the body; one that is given in this form is returned unchanged.

    Parameters
    ----------
    given : data set, its id, or mapping
    rows : str, optional
        ``START:STOP``, the samples of a data set to use.
    """
    if isinstance(given, Mapping):
        return given
    part = {"dataset": given if isinstance(given, str) else given.id}
    return part if rows is None else {**part, "rows": rows}
