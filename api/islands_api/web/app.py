"""The application: a value built from its parts. It reaches the database and the blobs, and never Ray."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.middleware.gzip import GZipMiddleware

from islands_api.web import exception_handlers
from islands_api.web.auth import KeyCache
from islands_api.web.concurrency import BlockingExecutor
from islands_api.web.dependencies import DRAWINGS, INSPECTIONS, AppState
from islands_api.web.event_hub import JobEventHub
from islands_api.web.middleware import BodyLimit, RequestLogging, SameOrigin
from islands_api.web.problems import ProblemDocument
from islands_api.web.prometheus import ServiceMetrics
from islands_api.web.rate_limit import RateLimiter
from islands_api.web.routes import ROUTERS
from islands_service.liveness import EVERY, send_heartbeat
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.tracing import Traces

#: Bytes from which on an answer is packed.
_PACKED = 4000

_DESCRIPTION = """Finds the equation behind measured data.

Upload a record, submit a job, follow it, and take its models: small difference equations with their metrics.
Or have a simulation held against the record: what it gets wrong, and why (`/v1/discrepancies`).
Every answer that is not a success is `application/problem+json`; its `detail` says what to do.
On this machine's own address no key is needed; elsewhere send `Authorization: Bearer islands_...`."""


def create_app(settings: ServiceSettings, store: Store | None = None) -> FastAPI:
    """Build the application.

    Parameters
    ----------
    settings : ServiceSettings
    store : Store, optional
        One that is open already, and is closed with the application.
    """
    traces = Traces(settings.telemetry, "api")

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = store or Store(settings.url)
        threads = BlockingExecutor()
        hub = JobEventHub(opened, threads)
        app.state.islands = state = AppState(
            settings,
            opened,
            Blobs(settings.blobs),
            hub,
            RateLimiter(settings.rate, settings.burst),
            ServiceMetrics(opened),
            asyncio.Semaphore(INSPECTIONS),
            asyncio.Semaphore(DRAWINGS),
            threads,
        )
        app.state.keys = KeyCache(state)
        tasks = [asyncio.create_task(hub.run()), asyncio.create_task(_live(settings.lifeline))]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task
            await state.run_blocking(opened.close)
            await state.run_blocking(traces.close)
            threads.close()

    app = FastAPI(
        title="islands",
        version=version("islands"),
        description=_DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,  # a path has one name
        openapi_url="/openapi.json",
    )
    for router in ROUTERS:
        app.include_router(router)
    exception_handlers.install_handlers(app)
    # Figures and the page take a third; a job on its own is too small to gain, and events are not held back.
    app.add_middleware(GZipMiddleware, minimum_size=_PACKED, compresslevel=5)
    app.add_middleware(BodyLimit, settings=settings)
    app.add_middleware(SameOrigin, settings=settings)
    app.add_middleware(RequestLogging)
    _trace(app, traces)
    _describe(app)
    return app


def _trace(app: FastAPI, traces: Traces) -> None:
    if traces.provider is not None:
        from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor  # noqa: PLC0415

        FastAPIInstrumentor.instrument_app(
            app, tracer_provider=traces.provider, excluded_urls="healthz,readyz,metrics"
        )


async def _live(descriptor: int | None) -> None:
    """Give signs of life from the event loop: if that hangs, nobody is answered."""
    while True:
        send_heartbeat(descriptor)
        await asyncio.sleep(EVERY)


def _describe(app: FastAPI) -> None:
    """Have the description name the document that every problem is."""

    def openapi() -> dict[str, object]:
        if app.openapi_schema is None:
            schema = get_openapi(
                title=app.title, version=app.version, description=app.description, routes=app.routes
            )
            document = ProblemDocument.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas = schema["components"]["schemas"]
            schemas.update(document.pop("$defs"))
            schemas["ProblemDocument"] = document
            _without_framework_answers(schema)
            app.openapi_schema = schema
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _without_framework_answers(schema: dict[str, object]) -> None:
    """Take out the answers to invalid requests that the framework would give, and we do not."""
    paths = schema["paths"]
    assert isinstance(paths, dict)
    for operations in paths.values():
        for operation in operations.values():
            operation["responses"].pop("422", None)
    schemas = schema["components"]["schemas"]  # type: ignore[index]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
