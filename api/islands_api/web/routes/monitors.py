"""Monitors: create, list, read, add a record, delete."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response

from islands.errors import SettingsError
from islands.simulators.specification.table import ExtendedSpec
from islands_api.monitor_schemas import (
    MonitorPage,
    MonitorRecordPage,
    MonitorRecordRequest,
    MonitorRequest,
    MonitorSummary,
    MonitorView,
)
from islands_api.result_schemas import SavedMonitorState
from islands_api.schemas import JobView
from islands_api.web.auth import Principal, Reader, Writer
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import (
    ACCEPTED_RESPONSES,
    IdempotencyKey,
    accept_job,
    get_job_of_kind,
    get_result,
)
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import (
    REVALIDATE,
    Cursor,
    IfNoneMatch,
    JSONRoute,
    Limit,
    decode_cursor,
    encode_cursor,
    matches_etag,
)
from islands_api.web.responses import JSONDocument, json_text, view_document
from islands_service.domain.job import DISCREPANCY, EXTENDED, MONITORING, Submission
from islands_service.domain.job_spec import parse_discrepancy
from islands_service.domain.monitor_spec import MonitorSpec, parse_monitor
from islands_service.domain.monitoring import Monitor
from islands_service.intake.job_validation import check_discrepancy

router = APIRouter(prefix="/v1/monitors", tags=["monitors"], responses=RESPONSES, route_class=JSONRoute)

#: Path parameter: the id of a monitor.
Id = Annotated[
    str,
    Path(
        pattern=r"^[0-9a-f]{32}$",
        description="A monitor's `id`.",
        examples=["c2f41d0a6b7e4d51a0e3b9f8d7c6a5b4"],
    ),
]

_CREATED: dict[int | str, dict[str, Any]] = {
    201: {
        "description": "Created.",
        "headers": {"Location": {"description": "Path of the monitor.", "schema": {"type": "string"}}},
    }
}

#: Maximum number of records of a page, some kB each.
_MAX_RECORDS = 1000

_ETAG = {"description": "Version of the monitor, for `If-None-Match`.", "schema": {"type": "string"}}

_CONDITIONAL: dict[int | str, dict[str, Any]] = {
    200: {"headers": {"ETag": _ETAG}},
    304: {"description": "Not changed.", "headers": {"ETag": _ETAG}},
}


@router.post("", status_code=201, response_model=MonitorView, responses=_CREATED)
async def create(request: MonitorRequest, caller: Writer, state: AppStateDep) -> Any:
    """Create a monitor of a diagnosed or given simulation. Its records follow one by one.

    The first `training` records are taken as the undisturbed state.
    """
    spec = await _make_spec(state, caller, request)
    # The name of a data set is part of the form, and not checked.
    check_discrepancy(spec.describe_record("none"))
    monitor = await state.run_blocking(
        state.store.monitors.create,
        caller.owner,
        request.name,
        spec.model_dump(mode="json", exclude_unset=True, by_alias=True),
        request.priority,
        state.settings.max_monitors,
        caller.requester,
    )
    location = f"{state.settings.root_path}{router.prefix}/{monitor.id}"
    return Response(_render(monitor, None), 201, {"Location": location}, "application/json")


@router.get("", response_model=MonitorPage)
async def monitors(caller: Reader, state: AppStateDep, cursor: Cursor = None, limit: Limit = 50) -> Any:
    """List the monitors, newest first, without their states."""
    page, after = await state.run_blocking(
        state.store.monitors.page, caller.owner, decode_cursor(cursor), limit
    )
    return JSONDocument(
        {"items": [view_document(each, MonitorSummary) for each in page], "next": encode_cursor(after)}
    )


@router.get("/{monitor}", response_model=MonitorView, responses=_CONDITIONAL)
async def monitor(monitor: Id, caller: Reader, state: AppStateDep, if_none_match: IfNoneMatch = None) -> Any:
    """Return a monitor: its parameters and effects, and the alarms with their beginning.

    With `If-None-Match`, the status is 304 if the monitor has not changed.
    """
    stored = await state.run_blocking(state.store.monitors.get, caller.owner, monitor)
    if matches_etag(if_none_match, tag := _make_etag(stored)):
        return Response(status_code=304, headers={"ETag": tag, "Cache-Control": REVALIDATE})
    stored, document = await state.run_blocking(state.store.monitors.result, caller.owner, monitor)
    headers = {"ETag": _make_etag(stored), "Cache-Control": REVALIDATE}
    return Response(_render(stored, document), headers=headers, media_type="application/json")


@router.get("/{monitor}/state", response_model=SavedMonitorState)
async def saved(monitor: Id, caller: Reader, state: AppStateDep) -> Response:
    """Return `state.json` of a monitor, from which `islands monitor` continues with the same bits."""
    text = await state.run_blocking(state.store.monitors.saved, caller.owner, monitor)
    if text is None:
        raise ResourceNotFoundError(f"monitor {monitor} has no state: wait for its first record")
    return Response(text, media_type="application/json")


@router.get("/{monitor}/records", response_model=MonitorRecordPage)
async def records(
    monitor: Id,
    caller: Reader,
    state: AppStateDep,
    after: Annotated[
        int, Query(ge=-1, le=2**31 - 1, description="Return only records after the one of this index.")
    ] = -1,
    limit: Annotated[
        int, Query(ge=1, le=_MAX_RECORDS, description="Maximum number of records.")
    ] = _MAX_RECORDS,
    rejected: Annotated[bool, Query(description="Return the rejected records instead.")] = False,
) -> Response:
    """Return the states of the effects in each record.

    The records have pages: repeat the request with `after` set to the last index until a page is empty.
    """
    texts = await state.run_blocking(
        state.store.monitors.records, caller.owner, monitor, rejected, after, limit
    )
    return Response(f'{{"items":[{",".join(texts)}]}}', media_type="application/json")


@router.post("/{monitor}/records", status_code=202, response_model=JobView, responses=ACCEPTED_RESPONSES)
async def add_record(
    monitor: Id,
    request: MonitorRecordRequest,
    caller: Writer,
    state: AppStateDep,
    idempotency_key: IdempotencyKey = None,
) -> Any:
    """Submit a job that analyses the next record of a monitor.

    Records are analysed one after the other in the order of submission, each exactly once. The job is
    followed and cancelled under `/v1/jobs`; its `result` has the states of this record and the alarms that
    it raised. A record that cannot be used fails its job and is listed with `rejected` of the records.
    """
    found = await state.run_blocking(state.store.monitors.get, caller.owner, monitor)
    submission = Submission(
        caller.owner,
        {"monitor": monitor, **request.model_dump(mode="json", exclude_unset=True)},
        MONITORING,
        request.name or found.name,
        found.priority,
        idempotency_key,
        monitor=monitor,
    )
    reading = parse_monitor(found.spec).describe_record(request.dataset, request.rows)
    return await accept_job(state, caller, reading, submission)


@router.delete("/{monitor}", status_code=204)
async def delete(monitor: Id, caller: Writer, state: AppStateDep) -> Response:
    """Delete a monitor with its states; records that wait are cancelled. Finished jobs are kept."""
    await state.run_blocking(state.store.monitors.delete, caller.owner, monitor, caller.requester)
    return Response(status_code=204)


async def _make_spec(state: AppState, caller: Principal, request: MonitorRequest) -> MonitorSpec:
    """Return the specification of a monitor, with the simulation of its diagnosis.

    Raises
    ------
    JobNotFoundError, ResourceNotFoundError, ResultNotReadyError
        The diagnosis does not exist, is no diagnosis, or has not succeeded.
    SettingsError
        It is that of an FMU.
    """
    given = request.model_dump(exclude_unset=True, exclude={"diagnosis", "name", "priority"})
    if request.diagnosis is None:
        return MonitorSpec.model_validate(given)
    job = await get_job_of_kind(state, caller, request.diagnosis, DISCREPANCY)
    await get_result(state, job)
    asked = parse_discrepancy(job.spec)
    if asked.fmu is not None:
        raise SettingsError(
            f"job {job.id} has diagnosed an FMU, which no monitor of a service simulates: run 'islands "
            "monitor' locally"
        )
    columns = (asked.input, *asked.channels)
    simulation = asked.simulation
    blob = await state.run_blocking(state.store.results.artefact, job.id, EXTENDED)
    if blob is not None:
        text = await state.run_blocking(state.blobs.read, blob)
        simulation = ExtendedSpec.model_validate(json.loads(text))
        columns = simulation.inputs
    known: dict[str, Any] = {
        "diagnosis": job.id,
        "input": columns[0],
        "output": asked.output,
        "channels": columns[1:],
    }
    if asked.dt is not None:
        known["dt"] = asked.dt
    return MonitorSpec.model_validate({"simulation": simulation, **known, **given})


def _make_etag(monitor: Monitor) -> str:
    """Return the tag of a monitor; records that are submitted change it as well."""
    return f'"{monitor.version}-{monitor.pending}"'


def _render(monitor: Monitor, document: str | None) -> bytes:
    """Return a monitor as JSON; its document is not parsed."""
    head = json_text({**view_document(monitor, MonitorSummary), "spec": monitor.spec})
    return f'{head[:-1]},"result":{document or "null"}}}'.encode()
