"""Events of a job as server-sent events. A client that reconnects continues after its last event."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import ExitStack, aclosing
from time import monotonic
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response
from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from islands_api.web.auth import KeyCache, Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import StrictRoute
from islands_api.web.responses import json_text
from islands_api.web.routes.jobs import Id
from islands_service.domain.job import LABELLED, TERMINAL, Event, Job

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], responses=RESPONSES, route_class=StrictRoute)

#: Idle seconds after which a comment is sent: some proxies close idle connections. After its key was revoked,
#: a stream ends within twice this time.
_KEEP_ALIVE_SECONDS = 7.0

#: Kinds of events of a job.
_EVENT_KINDS = ("queued", "running", "progress", "cancelling", "stopping", LABELLED, *TERMINAL)

_STREAM_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": f"Events: {', '.join(_EVENT_KINDS)}.",
        "content": {
            "text/event-stream": {
                # A type would be that of the text for some tools, and that of the list of events for others.
                "schema": {"description": "Events as lines of text."},
                "itemSchema": {
                    "type": "object",
                    "required": ["id", "event", "data"],
                    "properties": {
                        "id": {"type": "string", "pattern": "^[0-9]+$"},
                        "event": {"type": "string", "enum": list(_EVENT_KINDS)},
                        "data": {"type": "string", "contentMediaType": "application/json"},
                    },
                },
                "example": 'id: 7\nevent: progress\ndata: {"generation": 12, "best_error": 0.031}\n\n',
            }
        },
    },
    204: {"description": "The job has ended, and the client has its last event: do not reconnect."},
}


@router.get("/{job}/events", response_class=StreamingResponse, responses=_STREAM_RESPONSES)
async def events(
    request: Request,
    job: Id,
    caller: Reader,
    state: AppStateDep,
    last_event_id: Annotated[
        int, Header(ge=0, le=2**62, description="Number of the last event received; later ones are sent.")
    ] = 0,
) -> Response:
    """Stream the events of a job until it has ended. To continue a broken stream, send `Last-Event-ID`."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if found.state in TERMINAL and last_event_id >= found.version:
        # Any other end of the stream makes an EventSource of a browser reconnect.
        return Response(status_code=204)
    quotas = await state.quotas(caller.owner)
    # The event response of the framework builds a model of every event for each client: too slow for 500.
    with ExitStack() as counted:
        counted.enter_context(state.streams.count(caller.owner, quotas.max_streams))
        return _EventStream(
            # Limit the event number to existing events: a client with a larger one would wait for ever.
            _while_key_valid(
                request.app.state.keys, caller, _stream(state, found, min(last_event_id, found.version))
            ),
            counted.pop_all(),
        )


class _EventStream(StreamingResponse):
    """Stream that counts as one of its owner until it has ended."""

    def __init__(self, content: AsyncIterator[bytes], counted: ExitStack) -> None:
        # nginx buffers responses unless this header forbids it.
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        super().__init__(content, media_type="text/event-stream", headers=headers)
        self._counted = counted

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._counted:
            await super().__call__(scope, receive, send)


async def _stream(state: AppState, job: Job, last: int) -> AsyncGenerator[bytes]:
    with state.metrics.streams.track_inprogress():
        known = job.id, job.version, last, _KEEP_ALIVE_SECONDS, job.state in TERMINAL
        async with aclosing(state.hub.events(*known)) as events:
            async for event in events:
                yield b": alive\n\n" if event is None else _encode(event)


async def _while_key_valid(
    keys: KeyCache, caller: Principal, stream: AsyncGenerator[bytes]
) -> AsyncIterator[bytes]:
    checked_at = monotonic()
    async with aclosing(stream):
        async for chunk in stream:
            if monotonic() - checked_at >= _KEEP_ALIVE_SECONDS:
                if not await keys.is_still_valid(caller):
                    return
                checked_at = monotonic()
            yield chunk


def _encode(event: Event) -> bytes:
    data = json_text({**event.data, "at": event.at})
    return f"id: {event.number}\nevent: {event.kind}\ndata: {data}\n\n".encode()
