"""Base class of both clients: construction, request arguments, and one method for each call."""

from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from functools import update_wrapper
from inspect import Parameter, iscoroutinefunction, signature
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, get_args, overload

import httpx

from islands_api.client import calls, diagnosis_calls, monitor_calls, upload_calls
from islands_api.client.calls import RequestSpec, T
from islands_api.client.responses import JobFailedError
from islands_api.client.transport import (
    ANSWER_TIMEOUT,
    check_url,
    make_headers,
    make_ssl_context,
    make_timeout,
)
from islands_api.schemas import JobView
from islands_service.domain.job import JobState

H = TypeVar("H", httpx.Client, httpx.AsyncClient)
P = ParamSpec("P")


class Endpoint(Generic[P, T]):
    """Method of both clients that sends one call; `AsyncClient` returns a coroutine.

    Parameters
    ----------
    make_request : callable
        A function of `islands_api.client.calls`. The method has its parameters and its docstring.
    """

    def __init__(self, make_request: Callable[P, RequestSpec[T]]) -> None:
        def send(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> Any:
            return client.call(make_request(*args, **kwargs))

        async def send_async(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> Any:
            return await client.call(make_request(*args, **kwargs))

        declared = signature(make_request)
        own = Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)
        (answer,) = get_args(declared.return_annotation)
        method: Any
        for method in (send, send_async):
            update_wrapper(method, make_request)
            method.__signature__ = declared.replace(
                parameters=[own, *declared.parameters.values()], return_annotation=answer
            )
        self._send, self._send_async = send, send_async

    @overload
    def __get__(self, client: None, owner: type) -> Callable[Concatenate[Any, P], Any]: ...
    @overload
    def __get__(self, client: "BaseClient[httpx.Client]", owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, client: "BaseClient[httpx.AsyncClient]", owner: type
    ) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, client: Any, owner: Any) -> Any:
        method = self._send_async if iscoroutinefunction(getattr(owner, "call", None)) else self._send
        return method if client is None else method.__get__(client, owner)


class BaseClient(Generic[H]):
    """Constructor and calls of both clients.

    To add a call, add a function to one of the modules of calls and one line here.
    The parameters are described in `islands_api.client.synchronous.Client`.
    """

    upload = Endpoint(upload_calls.upload)
    fetch = Endpoint(upload_calls.fetch)
    samples = Endpoint(upload_calls.samples)
    read_again = Endpoint(upload_calls.read_again)
    presets = Endpoint(calls.presets)
    submit = Endpoint(calls.submit)
    diagnose = Endpoint(diagnosis_calls.diagnose)
    simulations = Endpoint(diagnosis_calls.simulations)
    check_equations = Endpoint(diagnosis_calls.check_equations)
    preview = Endpoint(diagnosis_calls.preview)
    outputs = Endpoint(diagnosis_calls.outputs)
    upload_fmu = Endpoint(upload_calls.upload_fmu)
    fmus = Endpoint(upload_calls.fmus)
    describe_fmu = Endpoint(upload_calls.describe_fmu)
    delete_fmu = Endpoint(upload_calls.delete_fmu)
    next_experiment = Endpoint(diagnosis_calls.next_experiment)
    job = Endpoint(calls.job)
    jobs = Endpoint(calls.jobs)
    datasets = Endpoint(calls.datasets)
    label = Endpoint(calls.label)
    stop = Endpoint(calls.stop)
    resume = Endpoint(calls.resume)
    delete = Endpoint(calls.delete)
    delete_dataset = Endpoint(calls.delete_dataset)
    models = Endpoint(calls.models)
    result = Endpoint(calls.result)
    report = Endpoint(calls.report)
    comparison_report = Endpoint(calls.comparison_report)
    extended = Endpoint(calls.extended)
    export_extended = Endpoint(calls.export_extended)
    history = Endpoint(calls.history)
    export = Endpoint(calls.export)
    figure = Endpoint(calls.figure)
    linear_system = Endpoint(calls.linear_system)
    export_linear_system = Endpoint(calls.export_linear_system)
    linear_figure = Endpoint(calls.linear_figure)
    simulate = Endpoint(calls.simulate)
    simulate_datasets = Endpoint(calls.simulate_datasets)
    free_run = Endpoint(calls.free_run)
    fmu = Endpoint(calls.fmu)
    create_monitor = Endpoint(monitor_calls.create_monitor)
    monitors = Endpoint(monitor_calls.monitors)
    monitor = Endpoint(monitor_calls.monitor)
    monitor_records = Endpoint(monitor_calls.monitor_records)
    monitor_state = Endpoint(monitor_calls.monitor_state)
    add_record = Endpoint(monitor_calls.add_record)
    delete_monitor = Endpoint(monitor_calls.delete_monitor)
    create_webhook = Endpoint(calls.create_webhook)
    webhooks = Endpoint(calls.webhooks)
    delete_webhook = Endpoint(calls.delete_webhook)
    deliveries = Endpoint(calls.deliveries)
    caller = Endpoint(calls.caller)
    admin_jobs = Endpoint(calls.admin_jobs)
    admin_cancel = Endpoint(calls.admin_cancel)

    _http_class: type[H]

    def __init__(
        self,
        url: str = "http://127.0.0.1:8000",
        key: str | None = None,
        *,
        timeout: float = ANSWER_TIMEOUT,
        retry: float = 30.0,
        verify: Any = True,
    ) -> None:
        self._http: H = self._http_class(
            base_url=check_url(url),
            headers=make_headers(key),
            timeout=make_timeout(timeout),
            verify=make_ssl_context(verify),
        )
        self._url, self._timeout, self._retry = url, timeout, retry

    def _request_arguments(self, call: RequestSpec[Any], until: float, stack: ExitStack) -> dict[str, Any]:
        """Return the arguments of `httpx.Client.request`; the stack closes the file that is uploaded."""
        files = None
        if call.file is not None:
            files = {"file": (call.file.name, stack.enter_context(call.file.open("rb")))}
        return {
            "method": call.method,
            "url": call.path,
            "params": dict(call.params),
            "headers": dict(call.headers),
            "json": call.json,
            "data": call.data,
            "files": files,
            "timeout": make_timeout(self._timeout, until),
        }


def check_succeeded(job: JobView) -> JobView:
    """Return an ended job if it has succeeded.

    Raises
    ------
    JobFailedError
        The job has failed or was cancelled.
    """
    if job.state != JobState.SUCCEEDED:
        detail = (job.problem or {}).get("detail", "it was cancelled")
        raise JobFailedError(f"job {job.id} {job.state}: {detail}")
    return job
