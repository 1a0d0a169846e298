"""Application factory. The application uses the database and the blobs, never Ray."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.middleware.gzip import GZipMiddleware

from islands.distribution import read_version
from islands_api.web import exception_handlers
from islands_api.web.auth import KeyCache, make_verifier
from islands_api.web.dependencies import open_state
from islands_api.web.middleware import BodyLimit, HeadRequests, RequestLogging, RootPath, SameOrigin
from islands_api.web.problems import ProblemDocument
from islands_api.web.requests import FormRoute
from islands_api.web.routes import ROUTERS
from islands_service.delivery_sender import DeliverySender
from islands_service.liveness import EVERY, send_heartbeat
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.telemetry import Traces

#: Least number of seconds between two complete checks of the database.
CHECK_SECONDS = 60.0

#: Minimum size in bytes of a response that is compressed.
_GZIP_MIN_BYTES = 4000

_DESCRIPTION = """Finds the equation behind measured data.

Upload a record, submit a job, follow it, and download its models: small difference equations with metrics.
Or compare a simulation with the record to find its errors and their causes (`/v1/discrepancies`).
Every error response is `application/problem+json`; its `detail` says what to do.
A loopback address needs no key. Elsewhere send `Authorization: Bearer islands_...`, or a token of the
identity provider of the service."""


def create_app(settings: ServiceSettings, store: Store | None = None) -> FastAPI:
    """Build the application.

    Parameters
    ----------
    settings : ServiceSettings
    store : Store, optional
        An open store, which the application closes at shutdown. Opened from the settings by default.
    """
    traces, tokens = Traces(settings.telemetry, "api"), make_verifier(settings)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        opened = store or Store(settings.url)
        async with open_state(settings, opened, tokens) as state:
            app.state.islands, app.state.keys = state, KeyCache(state)
            sender = DeliverySender(
                opened.deliveries, state.outbound, state.executor.run, state.metrics.observe_delivery
            )
            running = (state.hub.run(), sender.run(), _send_heartbeats(settings.lifeline))
            opened.readiness.watch(CHECK_SECONDS)
            tasks = [asyncio.create_task(each) for each in running]
            try:
                yield
            finally:
                opened.readiness.stop()
                for task in tasks:
                    task.cancel()
                    with suppress(asyncio.CancelledError):
                        await task
                await state.run_blocking(traces.close)

    app = FastAPI(
        title="islands",
        version=read_version(),
        description=_DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,  # each resource has exactly one path
        openapi_url="/openapi.json",
        # `include_router` would match each request twice, against its router and against the routes in it.
        routes=[route for router in ROUTERS for route in router.routes],
    )
    exception_handlers.install_handlers(app)
    # Compression reduces figures and the dashboard to a third. A single job is too small to gain from it.
    # Event streams are not buffered.
    app.add_middleware(GZipMiddleware, minimum_size=_GZIP_MIN_BYTES, compresslevel=5)
    app.add_middleware(BodyLimit, settings=settings, uploads=_list_upload_paths())
    app.add_middleware(SameOrigin, settings=settings)
    app.add_middleware(HeadRequests)
    app.add_middleware(RequestLogging)
    if settings.root_path:
        app.add_middleware(RootPath, root_path=settings.root_path)
    _install_tracing(app, traces)
    _install_openapi(app, settings.oidc_issuer)
    return app


def _list_upload_paths() -> frozenset[str]:
    routes = (route for router in ROUTERS for route in router.routes)
    return frozenset(each.path for each in routes if isinstance(each, FormRoute) and each.body_field)


def _install_tracing(app: FastAPI, traces: Traces) -> None:
    if traces.provider is not None:
        from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor  # noqa: PLC0415

        FastAPIInstrumentor.instrument_app(
            app, tracer_provider=traces.provider, excluded_urls="healthz,readyz,metrics"
        )


async def _send_heartbeats(descriptor: int | None) -> None:
    """Send heartbeats from the event loop, so that they stop if it hangs."""
    while True:
        send_heartbeat(descriptor)
        await asyncio.sleep(EVERY)


def _install_openapi(app: FastAPI, issuer: str) -> None:
    """Add the problem document, and the issuer of tokens if there is one, to the OpenAPI schema."""

    def openapi() -> dict[str, object]:
        if app.openapi_schema is None:
            schema = get_openapi(
                title=app.title, version=app.version, description=app.description, routes=app.routes
            )
            document = ProblemDocument.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas = schema["components"]["schemas"]
            schemas.update(document.pop("$defs"))
            schemas["ProblemDocument"] = document
            _remove_framework_responses(schema)
            if issuer:
                _add_token_scheme(schema, issuer)
            app.openapi_schema = schema
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _add_token_scheme(schema: dict[str, Any], issuer: str) -> None:
    """Describe tokens of an issuer as an alternative to keys."""
    url = f"{issuer.rstrip('/')}/.well-known/openid-configuration"
    schema["components"]["securitySchemes"]["token"] = {"type": "openIdConnect", "openIdConnectUrl": url}
    for operations in schema["paths"].values():
        for operation in operations.values():
            if "security" in operation:
                operation["security"].append({"token": []})


def _remove_framework_responses(schema: dict[str, object]) -> None:
    """Remove the framework's responses to invalid requests; this application sends problems instead."""
    paths = schema["paths"]
    assert isinstance(paths, dict)
    for operations in paths.values():
        for operation in operations.values():
            operation["responses"].pop("422", None)
    schemas = schema["components"]["schemas"]  # type: ignore[index]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
