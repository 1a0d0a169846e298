"""The client for programs that wait for each answer."""

from collections.abc import Iterator
from contextlib import ExitStack
from http import HTTPStatus
from math import inf
from time import monotonic, sleep
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


class Client:
    """Speaks to a service.

    A call that got no answer is sent again, for ``retry`` seconds, where that can do no harm: a job is
    submitted with an idempotency key, so it is one job however often it is sent.

    Parameters
    ----------
    url : str
        ``http://127.0.0.1:8000``.
    key : str, optional
        Of ``islands keys create``; on the service's own machine none is needed.
    timeout, retry : float
        Seconds for an answer, and for trying again from the first failure on.
    verify : str or Path or bool or ssl.SSLContext
        The file with the certificate of a private authority, or as httpx takes it.

    Raises
    ------
    SettingsError
        The address or the key is none.
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
        self._http = httpx.Client(
            base_url=parse_address(url),
            headers=make_headers(key),
            timeout=parse_timeout(timeout),
            verify=ssl_context(verify),
        )
        self._url, self._timeout, self._retry = url, timeout, retry

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __enter__(self) -> "Client":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def call(self, call: RequestSpec[T], until: float = inf) -> T:
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
                response = self._send(call, until)
            except httpx.TransportError as error:
                pause = tries.failed(error, call.repeatable)
            else:
                again = tries.answered(response, call.repeatable)
                if again is None:
                    refuse_problem(response)
                    return call.read(response)
                pause = again
            sleep(pause)

    def _send(self, call: RequestSpec[T], until: float) -> httpx.Response:
        with ExitStack() as stack:
            files = None
            if call.file is not None:
                files = {"file": (call.file.name, stack.enter_context(call.file.open("rb")))}
            return self._http.request(
                call.method,
                call.path,
                params=dict(call.params),
                headers=dict(call.headers),
                json=call.json,
                data=call.data,
                files=files,
                timeout=parse_timeout(self._timeout, until),
            )

    def upload(self, *arguments: Any, **named: Any) -> DatasetView:
        """Upload a record: see `islands_api.client.calls.upload`."""
        return self.call(calls.upload(*arguments, **named))

    def submit(self, *arguments: Any, **named: Any) -> JobView:
        """Submit a job: see `islands_api.client.calls.submit`."""
        return self.call(calls.submit(*arguments, **named))

    def diagnose(self, *arguments: Any, **named: Any) -> JobView:
        """Submit a discrepancy job: see `islands_api.client.diagnosis_calls.diagnose`."""
        return self.call(diagnosis_calls.diagnose(*arguments, **named))

    def job(self, which: JobRef) -> JobView:
        """Look at a job."""
        return self.call(calls.job(which))

    def jobs(self, state: str | None = None, cursor: str | None = None, limit: int = 50) -> JobPage:
        """List a page of jobs, newest first."""
        return self.call(calls.jobs(state, cursor, limit))

    def datasets(self, cursor: str | None = None, limit: int = 50) -> DatasetPage:
        """List a page of data sets, newest first."""
        return self.call(calls.datasets(cursor, limit))

    def cancel(self, which: JobRef) -> JobView:
        """Cancel a job; one that is cancelled already is returned as it is."""
        try:
            return self.call(calls.cancel(which))
        except ServiceError as error:
            # The first try may have done it, and its answer may have been lost.
            if error.status != HTTPStatus.CONFLICT:
                raise
            job = self.job(which)
            if job.state != JobState.CANCELLED:
                raise
            return job

    def resume(self, which: JobRef) -> JobView:
        """Have a job go on that failed or was cancelled."""
        return self.call(calls.resume(which))

    def delete(self, which: JobRef) -> None:
        """Delete a finished job."""
        self.call(calls.delete(which))

    def delete_dataset(self, which: calls.DatasetRef) -> None:
        """Delete a data set that no unfinished job needs."""
        self.call(calls.delete_dataset(which))

    def models(self, which: JobRef) -> tuple[ModelView, ...]:
        """Take the models of a job, best first."""
        return self.call(calls.models(which))

    def result(self, which: JobRef) -> dict[str, Any]:
        """Take the whole result, in the form of ``result.json``, or of ``discrepancy.json``."""
        return self.call(calls.result(which))

    def report(self, which: JobRef) -> bytes:
        """Take the report of a job: one HTML file."""
        return self.call(calls.report(which))

    def extended(self, which: JobRef) -> bytes:
        """Take the simulation with what it lacked, in the form of ``extended.json``."""
        return self.call(calls.extended(which))

    def history(self, which: JobRef, after: int = -1) -> HistoryPage:
        """Take a page of the course of the search behind a generation; an empty one is the end."""
        return self.call(calls.history(which, after))

    def export(self, which: JobRef, rank: int = 1, form: str = "python") -> str:
        """Take a model as text: python, c, matlab, latex, json and so on."""
        return self.call(calls.exported(which, rank, form))

    def figure(self, which: JobRef, name: str, rank: int | None = 1) -> bytes:
        """Take a figure of a model, or without a rank of the search, as SVG."""
        return self.call(calls.figure(which, name, rank))

    def figures(self, which: JobRef) -> tuple[tuple[str, int | None], ...]:
        """Return the figures of the search, and of the best model, as `figure` takes them."""
        of_search = self.call(calls.figure_names(which, None))
        of_best = self.call(calls.figure_names(which, 1))
        return (*((name, None) for name in of_search), *((name, 1) for name in of_best))

    def progress(self, which: JobRef, seconds: float = inf) -> Iterator[JobView]:
        """Yield a job as it is now, and after every change, until it has ended.

        A service that is started again meanwhile is waited for.

        Raises
        ------
        TimeoutError
            It has not ended within so many seconds.
        """
        until = monotonic() + seconds
        with in_time(calls.id_of(which), seconds, until):
            job = self.call(calls.job(which), until)
        yield job
        while job.state not in TERMINAL:
            with in_time(job.id, seconds, until):
                after = self.call(calls.changed(job, retry_after(self._timeout, until)), until)
            if after.version != job.version:
                yield after
            elif monotonic() > until:
                raise TimeoutError(f"job {job.id} is still {job.state} after {seconds:g} s")
            job = after

    def wait(self, which: JobRef, seconds: float = inf) -> JobView:
        """Wait until a job has succeeded, and return it.

        Raises
        ------
        JobFailedError
            It failed, or was cancelled.
        TimeoutError
        """
        for job in self.progress(which, seconds):  # noqa: B007 - the last one counts
            pass
        if job.state != JobState.SUCCEEDED:
            detail = (job.problem or {}).get("detail", "it was cancelled")
            raise JobFailedError(f"job {job.id} {job.state}: {detail}")
        return job

    def events(self, which: JobRef, after: int = 0) -> Iterator[Event]:
        """Yield the events of a job behind a number, until it has ended, over cut connections as well."""
        tries = RetryPolicy(self._url, self._retry)
        while True:
            lines = EventLines()
            try:
                headers = {"Last-Event-ID": str(after)}
                with self._http.stream("GET", calls.events_path(which), headers=headers) as response:
                    if response.status_code == HTTPStatus.NO_CONTENT:
                        return
                    if not response.is_success:
                        response.read()
                    pause = tries.answered(response)
                    if pause is None:
                        refuse_problem(response)
                        tries.succeeded()
                        for piece in response.iter_bytes():
                            for event in lines.feed(piece):
                                after = event.number
                                yield event
                        # A service that ends lets its streams end; one whose job has ended says so, by 204.
                        pause = tries.ended()
            except httpx.TransportError as error:
                pause = tries.failed(error)
            sleep(pause)
