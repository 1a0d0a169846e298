"""The client for programs that do other things meanwhile: the same calls, to be awaited."""

from asyncio import sleep
from collections.abc import AsyncIterator
from contextlib import ExitStack
from http import HTTPStatus
from math import inf
from time import monotonic
from types import TracebackType
from typing import Any, TypeVar

import httpx

from islands_api.client import calls, diagnosis_calls
from islands_api.client.calls import JobRef, RequestSpec
from islands_api.client.errors import JobFailedError, ServiceError
from islands_api.client.response_parsing import Event, EventLines, refuse_problem
from islands_api.client.transport import (
    PATIENCE,
    RetryPolicy,
    in_time,
    make_headers,
    parse_address,
    parse_timeout,
    retry_after,
    ssl_context,
)
from islands_api.schemas import DatasetPage, DatasetView, HistoryPage, JobPage, JobView, ModelView
from islands_service.domain.job import TERMINAL, JobState

T = TypeVar("T")


class AsyncClient:
    """Speaks to a service.

    The parameters are those of `islands_api.client.synchronous.Client`.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8000",
        key: str | None = None,
        *,
        timeout: float = PATIENCE,
        retry: float = 30.0,
        verify: Any = True,
    ) -> None:
        self._http = httpx.AsyncClient(
            base_url=parse_address(url),
            headers=make_headers(key),
            timeout=parse_timeout(timeout),
            verify=ssl_context(verify),
        )
        self._url, self._timeout, self._retry = url, timeout, retry

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> "AsyncClient":
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def call(self, call: RequestSpec[T], until: float = inf) -> T:
        """Carry out a call of `islands_api.client.calls`.

        Parameters
        ----------
        until : float
            The time of `time.monotonic` by which it has to be done.

        Raises
        ------
        ServiceError
            The service answered with a problem.
        ServiceUnreachableError
            It did not answer.
        """
        tries = RetryPolicy(self._url, self._retry, until)
        while True:
            try:
                response = await self._send(call, until)
            except httpx.TransportError as error:
                pause = tries.failed(error, call.repeatable)
            else:
                again = tries.answered(response, call.repeatable)
                if again is None:
                    refuse_problem(response)
                    return call.read(response)
                pause = again
            await sleep(pause)

    async def _send(self, call: RequestSpec[T], until: float) -> httpx.Response:
        with ExitStack() as stack:
            files = None
            if call.file is not None:
                files = {"file": (call.file.name, stack.enter_context(call.file.open("rb")))}
            return await self._http.request(
                call.method,
                call.path,
                params=dict(call.params),
                headers=dict(call.headers),
                json=call.json,
                data=call.data,
                files=files,
                timeout=parse_timeout(self._timeout, until),
            )

    async def upload(self, *arguments: Any, **named: Any) -> DatasetView:
        """Upload a record: see `islands_api.client.calls.upload`."""
        return await self.call(calls.upload(*arguments, **named))

    async def submit(self, *arguments: Any, **named: Any) -> JobView:
        """Submit a job: see `islands_api.client.calls.submit`."""
        return await self.call(calls.submit(*arguments, **named))

    async def diagnose(self, *arguments: Any, **named: Any) -> JobView:
        """Submit a discrepancy job: see `islands_api.client.diagnosis_calls.diagnose`."""
        return await self.call(diagnosis_calls.diagnose(*arguments, **named))

    async def job(self, which: JobRef) -> JobView:
        """Look at a job."""
        return await self.call(calls.job(which))

    async def jobs(self, state: str | None = None, cursor: str | None = None, limit: int = 50) -> JobPage:
        """List a page of jobs, newest first."""
        return await self.call(calls.jobs(state, cursor, limit))

    async def datasets(self, cursor: str | None = None, limit: int = 50) -> DatasetPage:
        """List a page of data sets, newest first."""
        return await self.call(calls.datasets(cursor, limit))

    async def cancel(self, which: JobRef) -> JobView:
        """Cancel a job; one that is cancelled already is returned as it is."""
        try:
            return await self.call(calls.cancel(which))
        except ServiceError as error:
            # The first try may have done it, and its answer may have been lost.
            if error.status != HTTPStatus.CONFLICT:
                raise
            job = await self.job(which)
            if job.state != JobState.CANCELLED:
                raise
            return job

    async def resume(self, which: JobRef) -> JobView:
        """Have a job go on that failed or was cancelled."""
        return await self.call(calls.resume(which))

    async def delete(self, which: JobRef) -> None:
        """Delete a finished job."""
        await self.call(calls.delete(which))

    async def delete_dataset(self, which: calls.DatasetRef) -> None:
        """Delete a data set that no unfinished job needs."""
        await self.call(calls.delete_dataset(which))

    async def models(self, which: JobRef) -> tuple[ModelView, ...]:
        """Take the models of a job, best first."""
        return await self.call(calls.models(which))

    async def result(self, which: JobRef) -> dict[str, Any]:
        """Take the whole result, in the form of ``result.json``, or of ``discrepancy.json``."""
        return await self.call(calls.result(which))

    async def report(self, which: JobRef) -> bytes:
        """Take the report of a job: one HTML file."""
        return await self.call(calls.report(which))

    async def extended(self, which: JobRef) -> bytes:
        """Take the simulation with what it lacked, in the form of ``extended.json``."""
        return await self.call(calls.extended(which))

    async def history(self, which: JobRef, after: int = -1) -> HistoryPage:
        """Take a page of the course of the search behind a generation; an empty one is the end."""
        return await self.call(calls.history(which, after))

    async def export(self, which: JobRef, rank: int = 1, form: str = "python") -> str:
        """Take a model as text: python, c, matlab, latex, json and so on."""
        return await self.call(calls.exported(which, rank, form))

    async def figure(self, which: JobRef, name: str, rank: int | None = 1) -> bytes:
        """Take a figure of a model, or without a rank of the search, as SVG."""
        return await self.call(calls.figure(which, name, rank))

    async def figures(self, which: JobRef) -> tuple[tuple[str, int | None], ...]:
        """Return the figures of the search, and of the best model, as `figure` takes them."""
        of_search = await self.call(calls.figure_names(which, None))
        of_best = await self.call(calls.figure_names(which, 1))
        return (*((name, None) for name in of_search), *((name, 1) for name in of_best))

    async def progress(self, which: JobRef, seconds: float = inf) -> AsyncIterator[JobView]:
        """Yield a job as it is now, and after every change, until it has ended.

        A service that is started again meanwhile is waited for.

        Raises
        ------
        TimeoutError
            It has not ended within so many seconds.
        """
        until = monotonic() + seconds
        with in_time(calls.id_of(which), seconds, until):
            job = await self.call(calls.job(which), until)
        yield job
        while job.state not in TERMINAL:
            with in_time(job.id, seconds, until):
                after = await self.call(calls.changed(job, retry_after(self._timeout, until)), until)
            if after.version != job.version:
                yield after
            elif monotonic() > until:
                raise TimeoutError(f"job {job.id} is still {job.state} after {seconds:g} s")
            job = after

    async def wait(self, which: JobRef, seconds: float = inf) -> JobView:
        """Wait until a job has succeeded, and return it.

        Raises
        ------
        JobFailedError
            It failed, or was cancelled.
        TimeoutError
        """
        async for job in self.progress(which, seconds):  # noqa: B007 - the last one counts
            pass
        if job.state != JobState.SUCCEEDED:
            detail = (job.problem or {}).get("detail", "it was cancelled")
            raise JobFailedError(f"job {job.id} {job.state}: {detail}")
        return job

    async def events(self, which: JobRef, after: int = 0) -> AsyncIterator[Event]:
        """Yield the events of a job behind a number, until it has ended, over cut connections as well."""
        tries = RetryPolicy(self._url, self._retry)
        while True:
            lines = EventLines()
            try:
                headers = {"Last-Event-ID": str(after)}
                async with self._http.stream("GET", calls.events_path(which), headers=headers) as response:
                    if response.status_code == HTTPStatus.NO_CONTENT:
                        return
                    if not response.is_success:
                        await response.aread()
                    pause = tries.answered(response)
                    if pause is None:
                        refuse_problem(response)
                        tries.succeeded()
                        async for piece in response.aiter_bytes():
                            for event in lines.feed(piece):
                                after = event.number
                                yield event
                        # A service that ends lets its streams end; one whose job has ended says so, by 204.
                        pause = tries.ended()
            except httpx.TransportError as error:
                pause = tries.failed(error)
            await sleep(pause)
