"""Calls that make data sets: the client sends a file, or the service downloads it."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from islands_api.client.calls import RequestSpec, as_list
from islands_api.client.response_parsing import read_as
from islands_api.dataset_schemas import DatasetView


def upload(
    path: str | Path,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    reading: Mapping[str, Any] | None = None,
) -> RequestSpec[DatasetView]:
    """Upload a record in text, XLSX, NPZ, MAT, HDF5, Parquet or TDMS.

    Parameters
    ----------
    path : str or Path
    inputs : str or sequence of str
        Input columns. If columns are given, the service checks the record as it does for a job.
    output, dt : str, float, optional
        Output column, and sampling time in seconds if the record has no time column.
    reading : mapping, optional
        Options of `islands.read_record` for all jobs, such as ``{"header": False}``.
    """
    options = json.dumps(dict(reading)) if reading else None
    given: dict[str, Any] = {"inputs": as_list(inputs) or None, "output": output, "dt": dt}
    form = {name: value for name, value in (given | {"reading": options}).items() if value is not None}
    return RequestSpec("POST", "/v1/datasets", read_as(DatasetView), data=form, file=Path(path))


def fetch(
    url: str,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    reading: Mapping[str, Any] | None = None,
    name: str | None = None,
) -> RequestSpec[DatasetView]:
    """Let the service download a record, from a host or bucket that its operator has listed.

    Parameters
    ----------
    url : str
        ``https://HOST/PATH`` or ``s3://BUCKET/KEY``.
    inputs, output, dt, reading
        As for `upload`.
    name : str, optional
        File name, whose suffix selects the reader; by default the last part of the URL's path.
    """
    asked = {
        "inputs": as_list(inputs),
        "output": output,
        "dt": dt,
        "reading": dict(reading or {}),
        "name": name,
    }
    given = {field: value for field, value in asked.items() if value}
    return RequestSpec("POST", "/v1/datasets/fetch", read_as(DatasetView), json={"url": url, **given})
