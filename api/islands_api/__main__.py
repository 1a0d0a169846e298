"""``python -m islands_api``: the web server, as a child of ``islands serve`` or standalone."""

import gc
import resource
import socket
import ssl
import sys
from contextlib import suppress
from errno import EADDRINUSE
from time import monotonic, sleep

import uvicorn

from islands.errors import IslandsError, SettingsError
from islands_api.web.app import create_app
from islands_service.logging_config import configure_logs
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store import Store
from islands_service.supervisor import MISCONFIGURED

#: Seconds that open requests have to finish at shutdown.
_SHUTDOWN_SECONDS = 2

#: Seconds for which a port in use is tried again: its previous owner may be shutting down.
_PORT_RETRY_SECONDS = 2.0

#: Arguments of `gc.set_threshold`: allocations per collection of generation 0, collections per older one.
_GC_THRESHOLDS = 10_000, 20, 20

#: Upper bound on the limit of open files. Each connection takes one.
_MAX_OPEN_FILES = 65_536

#: Length of the queue of connections that wait to be accepted.
_BACKLOG = 2048


def main() -> int:
    """Serve until SIGTERM or SIGINT."""
    if sys.argv[1:]:
        print(
            f"islands: the web server takes no arguments, got {' '.join(sys.argv[1:])}: "
            "the command line is 'islands' or 'python -m islands'",
            file=sys.stderr,
        )
        return MISCONFIGURED
    try:
        settings = service_settings()
        configure_logs(settings.log_format, "api")
        store = Store(settings.url)
        check_safe(settings, store)
        listener = open_listener(settings.host, settings.port)
    except IslandsError as error:
        print(f"islands: {error}", file=sys.stderr)
        return MISCONFIGURED if isinstance(error, SettingsError) else 1
    server = _Server(
        uvicorn.Config(
            create_app(settings, store),
            access_log=False,
            log_config=None,
            timeout_graceful_shutdown=_SHUTDOWN_SECONDS,
            ssl_certfile=settings.tls_certificate,
            ssl_keyfile=settings.tls_key,
            server_header=False,
        )
    )
    _freeze_garbage_collector()
    raise_file_limit()
    server.run([listener])
    return 0 if server.started else MISCONFIGURED


class _Server(uvicorn.Server):
    """Server that closes the event streams first; they would outlast the shutdown timeout."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the event streams, then shut down."""
        self.config.app.state.islands.hub.close()  # type: ignore[union-attr]
        await super().shutdown(sockets)


def _freeze_garbage_collector() -> None:
    """Exclude all present objects from garbage collection, and collect less often.

    A full collection over a hundred thousand objects delays every request by some hundredths of a second.
    Without it the throughput is 50 % higher, and the slowest requests take a third of the time.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_GC_THRESHOLDS)


def raise_file_limit() -> None:
    """Raise the soft limit of open files to the hard limit; the default is about a thousand."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = _MAX_OPEN_FILES if hard == resource.RLIM_INFINITY else min(hard, _MAX_OPEN_FILES)
    if soft != resource.RLIM_INFINITY and soft < limit:
        # Some systems enforce a lower limit than the hard limit that they report.
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


def check_safe(settings: ServiceSettings, store: Store) -> None:
    """Check that a service that other machines can reach needs keys, and that the TLS files are usable.

    Raises
    ------
    SettingsError
        No valid key exists although keys are needed, or the certificate and the key are not a pair.
    """
    if settings.keys_needed and not store.keys.any_valid():
        raise SettingsError(
            f"{settings.host} can be reached by other machines, and there is no key: create one with "
            "'islands keys create --scope read --scope write', or serve on 127.0.0.1"
        )
    if (settings.tls_certificate is None) != (settings.tls_key is None):
        raise SettingsError("TLS needs both a certificate and a key: give --tls-certificate and --tls-key")
    for path in (settings.tls_certificate, settings.tls_key):
        if path is not None and not path.is_file():
            raise SettingsError(f"there is no file {path}: check the path of the certificate and of the key")
    if settings.tls_certificate is not None:
        try:
            ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(
                settings.tls_certificate, settings.tls_key
            )
        except (OSError, ssl.SSLError) as error:
            raise SettingsError(
                f"{settings.tls_certificate} and {settings.tls_key} are not a certificate and its key "
                f"({error}): give two PEM files that match"
            ) from error


def open_listener(host: str, port: int) -> socket.socket:
    """Open a listening socket.

    Raises
    ------
    SettingsError
        The address does not belong to this machine, or another program uses the port.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    deadline = monotonic() + _PORT_RETRY_SECONDS
    while True:
        try:
            return socket.create_server((host, port), family=family, backlog=_BACKLOG)
        except OSError as error:
            if error.errno == EADDRINUSE and monotonic() < deadline:
                sleep(0.05)
                continue
            reason = "another program uses it" if error.errno == EADDRINUSE else error.strerror
            raise SettingsError(
                f"cannot listen at {host}, port {port} ({reason}): give another --port, or an "
                "address of this machine as --host"
            ) from error


if __name__ == "__main__":
    sys.exit(main())
