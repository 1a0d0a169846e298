"""Data sets: upload, inspect, list, delete."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import fastapi
import numpy as np
from fastapi import APIRouter, File, Form, Query, Response, UploadFile
from numpy.typing import NDArray
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from islands.document_problems import find_problem
from islands.errors import SettingsError
from islands.records.reading.options import ReadingOptions
from islands.records.reading.table import select
from islands_api.dataset_schemas import DatasetPage, DatasetView, FetchRequest, ReadingRequest, Samples
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import (
    Cursor,
    FormRoute,
    IfNoneMatch,
    JSONRoute,
    Limit,
    Points,
    StartRow,
    StopRow,
    decode_cursor,
    describe_upload,
    encode_cursor,
    matches_etag,
)
from islands_api.web.responses import JSONDocument, dataset_document, dataset_summary
from islands_api.web.uploads import (
    check_source,
    fetch,
    find_file_name,
    open_stored,
    parse_file_name,
    read_again,
    store_dataset,
)
from islands_service.domain.job_spec import Name
from islands_service.domain.plot_envelopes import describe_envelopes
from islands_service.intake.file_inspection import InspectionRequest
from islands_service.intake.record_reading import read_columns
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


router = APIRouter(prefix="/v1/datasets", tags=["data sets"], responses=RESPONSES, route_class=FormRoute)

#: The same path for requests in JSON.
fetching = APIRouter(prefix=router.prefix, tags=["data sets"], responses=RESPONSES, route_class=JSONRoute)

_READING = TypeAdapter(ReadingOptions)

_UPLOAD_RESPONSES = describe_upload(DatasetView, "data set")

Id = Annotated[
    str,
    fastapi.Path(
        pattern=r"^[0-9A-Za-z_-]{1,48}$",
        description="A data set's `id`.",
        examples=["9f86d081884c7d659a2feaa0c55ad015-csv"],
    ),
]


@router.post(
    "",
    status_code=201,
    response_model=DatasetView,
    responses=_UPLOAD_RESPONSES,
    form_limits={"max_files": 1, "max_fields": 200, "max_part_size": 10_000},
)
async def upload(
    file: Annotated[
        UploadFile,
        File(
            description="Text, XLSX, NPZ, MAT, HDF5, Parquet or TDMS; also .gz",
            # The framework writes `contentMediaType` alone, which generators of clients take for text.
            json_schema_extra={"format": "binary"},
        ),
    ],
    caller: Writer,
    state: AppStateDep,
    inputs: Annotated[list[Name], Form(max_length=16, description="Columns to check as inputs.")] = [],  # noqa: B006
    output: Annotated[Name | None, Form(description="Column to check as the output.")] = None,
    dt: Annotated[FiniteFloat | None, Form(description="Sampling time in seconds.", gt=0.0)] = None,
    reading: Annotated[
        str, Form(max_length=10_000, description='Options of reading as JSON: `{"names": ["t", "u", "y"]}`.')
    ] = "{}",
) -> Any:
    """Upload a record.

    The response lists the columns with units and statistics, and the problems of columns that cannot be used.
    With `inputs` and `output`, the record is validated as for a job and rejected if a job could not use it;
    with only one of them, only these columns are validated. The same bytes that are read in the same way are
    the same data set: the status is then 200 instead of 201.
    """
    name, compressed = parse_file_name(file.filename)
    request = InspectionRequest(tuple(inputs), output, dt, reading=_read_options(reading))
    stored, new = await store_dataset(state, caller, file.file, name, compressed, request)
    return await _make_response(state, stored, new)


@fetching.post("/fetch", status_code=201, response_model=DatasetView, responses=_UPLOAD_RESPONSES)
async def fetch_dataset(asked: FetchRequest, caller: Writer, state: AppStateDep) -> Any:
    """Let the service download a record from a host or bucket that its operator has listed.

    The file is checked, stored and counted like an upload. The URL without its query is the `source` of the
    data set. Without a listed host or bucket, every URL is refused.
    """
    source = check_source(asked.url, state.settings)
    name, compressed = parse_file_name(asked.name or find_file_name(source))
    reading = _read_options(json.dumps(asked.reading))
    request = InspectionRequest(tuple(asked.inputs), asked.output, asked.dt, reading=reading)
    async with fetch(state, caller, asked.url) as file:
        stored, new = await store_dataset(state, caller, file, name, compressed, request, source)
    return await _make_response(state, stored, new)


@fetching.post(
    "/{dataset}/readings", status_code=201, response_model=DatasetView, responses=_UPLOAD_RESPONSES
)
async def make_reading(dataset: Id, asked: ReadingRequest, caller: Writer, state: AppStateDep) -> Any:
    """Read a data set in another way, without another upload: with gaps split, resampled, or without repair.

    The response is the data set of the same bytes that are read with these options, all others being at their
    defaults. It is checked like an upload. A note of a data set names the options that help.
    """
    stored = await state.run_blocking(state.store.datasets.get, caller.owner, dataset)
    reading = _read_options(json.dumps(asked.reading))
    request = InspectionRequest(tuple(asked.inputs), asked.output, asked.dt, reading=reading)
    return await _make_response(state, *(await read_again(state, caller, stored, request)))


async def _make_response(state: AppState, stored: StoredDataset, new: bool) -> JSONDocument:
    retention = await _find_retention(state, stored.owner, (stored,))
    headers = {"Location": f"{state.settings.root_path}{router.prefix}/{stored.id}"}
    return JSONDocument(dataset_document(stored, retention), 201 if new else 200, headers)


def _read_options(text: str) -> Mapping[str, Any]:
    """Read the options of reading a record; return those that are not at their defaults.

    Raises
    ------
    SettingsError
        They are not a JSON object, or an option is unknown or invalid.
    """
    try:
        return _READING.validate_json(text, strict=True, extra="forbid").changes()
    except ValidationError as error:
        example = (
            'reading is a JSON object of options, for example {"names": ["t", "u", "y"], "gaps": "split"}'
        )
        place, problem = find_problem(error, ReadingOptions)
        raise SettingsError(": ".join(filter(None, (example, place, problem)))) from error


@router.get("", response_model=DatasetPage)
async def datasets(caller: Reader, state: AppStateDep, cursor: Cursor = None, limit: Limit = 50) -> Any:
    """List the data sets, newest first: with the number of columns, without the columns themselves."""
    page, after = await state.run_blocking(
        state.store.datasets.page, caller.owner, decode_cursor(cursor), limit
    )
    retention = await _find_retention(state, caller.owner, page)
    return JSONDocument(
        {"items": [dataset_summary(dataset, retention) for dataset in page], "next": encode_cursor(after)}
    )


@router.get("/{dataset}", response_model=DatasetView)
async def dataset(dataset: Id, caller: Reader, state: AppStateDep) -> Any:
    """Return a data set: columns, units, statistics, sampling, warnings."""
    stored = await state.run_blocking(state.store.datasets.get, caller.owner, dataset)
    return JSONDocument(dataset_document(stored, await _find_retention(state, caller.owner, (stored,))))


@router.get("/{dataset}/samples", response_model=Samples, responses={304: {"description": "Not modified."}})
async def samples(
    dataset: Id,
    caller: Reader,
    state: AppStateDep,
    column: Annotated[list[Name], Query(min_length=1, max_length=16, description="Columns, one each.")],
    start: StartRow = 0,
    stop: StopRow = None,
    points: Points = 2000,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Return columns for a plot: the least and the greatest value of every part of the rows.

    Every peak is in the answer, whatever the number of points. Columns are read whole, and kept in memory as
    long as they are in use. An answer does not change.
    """
    stored = await state.run_blocking(state.store.datasets.get, caller.owner, dataset)
    asked = dataset, tuple(column), start, stop, points
    tag = f'"{hashlib.sha256(repr(asked).encode()).hexdigest()[:32]}"'
    headers = {"Cache-Control": "private, max-age=86400, immutable", "Vary": "Authorization", "ETag": tag}
    if matches_etag(if_none_match, tag):
        return Response(status_code=304, headers=headers)
    columns = await get_columns(state, caller.owner, stored, column)
    rows = slice(start, stop)
    found = await state.run_blocking(describe_rows, columns, column, stored.name, rows, points)
    return JSONDocument(found, headers=headers)


async def _find_retention(state: AppState, owner: str, found: Sequence[StoredDataset]) -> int:
    """Return the retention of an owner if one of the data sets needs it."""
    if all(dataset.idle_since is None for dataset in found):
        return 0
    return (await state.quotas(owner)).dataset_retention


@router.delete("/{dataset}", status_code=204)
async def delete(dataset: Id, caller: Writer, state: AppStateDep) -> None:
    """Delete a data set that no unfinished job needs.

    The figures of finished jobs can still be drawn: the bytes are kept, and count towards the quota,
    until these jobs are deleted.
    """
    await state.run_blocking(state.store.datasets.delete, caller.owner, dataset, caller.requester)
