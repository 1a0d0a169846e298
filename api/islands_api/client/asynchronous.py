"""Client for asyncio."""

from asyncio import sleep
from collections.abc import AsyncIterator
from contextlib import ExitStack
from http import HTTPStatus
from math import inf
from time import monotonic

import httpx

from islands_api.client import calls
from islands_api.client.base import BaseClient, check_succeeded
from islands_api.client.calls import JobRef, RequestSpec, T
from islands_api.client.responses import Event, EventParser, ServiceError, raise_for_problem
from islands_api.client.transport import RetryPolicy, long_poll_seconds, translate_timeout
from islands_api.schemas import JobView
from islands_service.domain.job import TERMINAL, JobState


class AsyncClient(BaseClient[httpx.AsyncClient]):
    """Client of a service for asyncio; the calls are those of `Client`, to be awaited.

    The parameters are those of `islands_api.client.synchronous.Client`.
    """

    _http_class = httpx.AsyncClient

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> "AsyncClient":
        return self

    async def __aexit__(self, *_error: object) -> None:
        await self.close()

    async def call(self, call: RequestSpec[T], until: float = inf) -> T:
        """Send a request of `islands_api.client.calls` and return its answer.

        Parameters
        ----------
        until : float
            Deadline on the clock of `time.monotonic`.

        Raises
        ------
        ServiceError
            The service answered with a problem.
        ServiceUnreachableError
            The service did not answer.
        """
        policy = RetryPolicy(self._url, self._retry, until)
        while True:
            try:
                with ExitStack() as stack:
                    response = await self._http.request(**self._request_arguments(call, until, stack))
            except httpx.TransportError as error:
                pause = policy.delay_after_error(error, call.repeatable)
            else:
                delay = policy.delay_after_response(response, call.repeatable)
                if delay is None:
                    raise_for_problem(response)
                    return call.read(response)
                pause = delay
            await sleep(pause)

    async def cancel(self, which: JobRef) -> JobView:
        """Cancel a job and return it. Cancelling a cancelled job changes nothing."""
        try:
            return await self.call(calls.cancel(which))
        except ServiceError as error:
            # An earlier attempt may have cancelled the job although its answer was lost.
            if error.status != HTTPStatus.CONFLICT:
                raise
            job = await self.job(which)
            if job.state != JobState.CANCELLED:
                raise
            return job

    async def figures(self, which: JobRef) -> tuple[tuple[str, int | None], ...]:
        """Return name and rank of each figure of the search and of the recommended model, for `figure`."""
        of_search = await self.call(calls.figure_names(which, None))
        rank = calls.get_recommended_rank(await self.call(calls.job(which)))
        of_model = await self.call(calls.figure_names(which, rank))
        return (*((name, None) for name in of_search), *((name, rank) for name in of_model))

    async def progress(self, which: JobRef, seconds: float = inf) -> AsyncIterator[JobView]:
        """Yield a job now and after each change, until it has ended.

        If the service restarts meanwhile, the iterator continues when the service is back.

        Raises
        ------
        TimeoutError
            The job has not ended within this number of seconds.
        """
        until = monotonic() + seconds
        with translate_timeout(calls.get_id(which), seconds, until):
            job = await self.call(calls.job(which), until)
        yield job
        while job.state not in TERMINAL:
            with translate_timeout(job.id, seconds, until):
                after = await self.call(
                    calls.await_change(job, long_poll_seconds(self._timeout, until)), until
                )
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
            The job has failed or was cancelled.
        TimeoutError
            The job has not ended within this number of seconds.
        """
        async for job in self.progress(which, seconds):  # noqa: B007 - the last one counts
            pass
        return check_succeeded(job)

    async def events(self, which: JobRef, after: int = 0) -> AsyncIterator[Event]:
        """Yield the events of a job after a number until it has ended; reconnect if the connection breaks."""
        policy = RetryPolicy(self._url, self._retry)
        while True:
            parser = EventParser()
            try:
                headers = {"Last-Event-ID": str(after)}
                async with self._http.stream("GET", calls.events_path(which), headers=headers) as response:
                    if response.status_code == HTTPStatus.NO_CONTENT:
                        return
                    if not response.is_success:
                        await response.aread()
                    pause = policy.delay_after_response(response)
                    if pause is None:
                        raise_for_problem(response)
                        policy.reset()
                        async for piece in response.aiter_bytes():
                            for event in parser.feed(piece):
                                after = event.number
                                yield event
                        # A stream also ends when the service stops. The end of the job is answered by 204.
                        pause = policy.delay_after_stream()
            except httpx.TransportError as error:
                pause = policy.delay_after_error(error)
            await sleep(pause)
