"""Web server: uvicorn with the configuration of this service."""

import socket

import uvicorn
from fastapi import FastAPI

from islands_api.server.http_protocol import HTTPProtocol
from islands_service.settings import ServiceSettings

#: Seconds that open requests have to finish at shutdown.
_SHUTDOWN_SECONDS = 2

#: Seconds for which an idle connection is kept after a response.
_KEEP_ALIVE_SECONDS = 30


class HTTPServer(uvicorn.Server):
    """Server that closes the event streams first; they would outlast the shutdown timeout."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the event streams, then shut down."""
        self.config.app.state.islands.hub.close()  # type: ignore[union-attr]
        await super().shutdown(sockets)


def make_server_config(app: FastAPI, settings: ServiceSettings) -> uvicorn.Config:
    """Return the configuration of uvicorn for an application."""
    return uvicorn.Config(
        app,
        http=HTTPProtocol,
        ws="none",
        access_log=False,
        log_config=None,
        timeout_graceful_shutdown=_SHUTDOWN_SECONDS,
        timeout_keep_alive=_KEEP_ALIVE_SECONDS,
        ssl_certfile=settings.tls_certificate,
        ssl_keyfile=settings.tls_key,
        server_header=False,
        # Without trusted proxies the header X-Forwarded-For of any client would change its address.
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
    )
