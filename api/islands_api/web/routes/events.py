"""Events of a job as they happen: server-sent events that go on where a client was cut off."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing
from time import monotonic
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response
from fastapi.responses import StreamingResponse

from islands_api.web.auth import KeyCache, Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.responses import json_text
from islands_api.web.routes.jobs import Id
from islands_service.domain.job import TERMINAL, Event, Job

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], responses=RESPONSES)

#: Seconds of silence after which a comment is sent: a connection that says nothing is cut by some proxies.
#: A stream outlives its key's revocation for twice as long at the most.
_ALIVE = 7.0

#: What may happen to a job.
_KINDS = ("queued", "running", "progress", "cancelling", "succeeded", "failed", "cancelled")

_EVENTS: dict[int | str, dict[str, Any]] = {
    200: {
        "description": f"Events: {', '.join(_KINDS)}.",
        "content": {
            "text/event-stream": {
                "itemSchema": {
                    "type": "object",
                    "required": ["id", "event", "data"],
                    "properties": {
                        "id": {"type": "string", "pattern": "^[0-9]+$"},
                        "event": {"type": "string", "enum": list(_KINDS)},
                        "data": {"type": "string", "contentMediaType": "application/json"},
                    },
                },
                "example": 'id: 7\nevent: progress\ndata: {"generation": 12, "best_error": 0.031}\n\n',
            }
        },
    },
    204: {"description": "The job has ended, and its last event was seen: do not come back."},
}


@router.get("/{job}/events", response_class=StreamingResponse, responses=_EVENTS)
async def events(
    request: Request,
    job: Id,
    caller: Reader,
    state: AppStateDep,
    last_event_id: Annotated[
        int, Header(ge=0, le=2**62, description="The last event that was seen: what came after it is sent.")
    ] = 0,
) -> Response:
    """Follow a job until it has ended; who is cut off comes back with `Last-Event-ID`."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if found.state in TERMINAL and last_event_id >= found.version:
        # A browser's event source comes back after every end but this one.
        return Response(status_code=204)
    # The framework's own event response makes a model of every event for every client; five hundred watch.
    return StreamingResponse(
        # Nobody has seen what has not happened yet: who says so would wait for ever.
        _while_open(request.app.state.keys, caller, _stream(state, found, min(last_event_id, found.version))),
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store"},
    )


async def _stream(state: AppState, job: Job, last: int) -> AsyncGenerator[bytes]:
    with state.metrics.streams.track_inprogress():
        async with aclosing(state.hub.events(job.id, job.version, last, _ALIVE)) as events:
            async for event in events:
                yield b": alive\n\n" if event is None else _encoded(event)


async def _while_open(
    keys: KeyCache, caller: Principal, stream: AsyncGenerator[bytes]
) -> AsyncIterator[bytes]:
    let_in = monotonic()
    async with aclosing(stream):
        async for piece in stream:
            if monotonic() - let_in >= _ALIVE:
                if not await keys.is_still_valid(caller):
                    return
                let_in = monotonic()
            yield piece


def _encoded(event: Event) -> bytes:
    data = json_text({**event.data, "at": event.at})
    return f"id: {event.number}\nevent: {event.kind}\ndata: {data}\n\n".encode()
