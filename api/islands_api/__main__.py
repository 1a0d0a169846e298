"""``python -m islands_api``: the doors, as a child of ``islands serve`` or on their own."""

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

#: Seconds that open requests have to end; a stream of events would never.
_GRACE = 2

#: Seconds that a port may be taken: who was there before us may be ending.
_TAKEN = 2.0

#: New objects after which garbage is looked for among them, and how often before it is among older ones.
_GARBAGE = 10_000, 20, 20

#: Files that may be open at once, where the machine allows as many: every connection is one.
_FILES = 65_536

#: Connections that may wait to be accepted.
_WAITING = 2048


def main() -> int:
    """Serve until SIGTERM or SIGINT."""
    try:
        settings = service_settings()
        configure_logs(settings.log_format, "api")
        store = Store(settings.url)
        check_safe(settings, store)
        listener = listening(settings.host, settings.port)
    except IslandsError as error:
        print(f"islands: {error}", file=sys.stderr)
        return MISCONFIGURED if isinstance(error, SettingsError) else 1
    server = _Server(
        uvicorn.Config(
            create_app(settings, store),
            access_log=False,
            log_config=None,
            timeout_graceful_shutdown=_GRACE,
            ssl_certfile=settings.tls_certificate,
            ssl_keyfile=settings.tls_key,
            server_header=False,
        )
    )
    _settle()
    raise_file_limit()
    server.run([listener])
    return 0 if server.started else MISCONFIGURED


class _Server(uvicorn.Server):
    """A server that ends the streams of events first: by themselves they would not end in its grace."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End all that is open."""
        self.config.app.state.islands.hub.close()  # type: ignore[union-attr]
        await super().shutdown(sockets)


def _settle() -> None:
    """Leave what was made until now, and stays, to itself when garbage is looked for.

    A look at a hundred thousand objects holds every request up for some hundredths of a second. Without it
    half as many requests again are answered, and the slowest in a third of the time.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_GARBAGE)


def raise_file_limit() -> None:
    """Allow as many open files as this process may allow itself: by default they are a thousand or so."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _FILES if hard == resource.RLIM_INFINITY else min(hard, _FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        # Some systems have a limit of their own below the one that they tell.
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def check_safe(settings: ServiceSettings, store: Store) -> None:
    """Refuse to be reached by others without a key.

    Raises
    ------
    SettingsError
    """
    if settings.keys_needed and not store.keys.any_valid():
        raise SettingsError(
            f"{settings.host} can be reached by others, and there is no key: make one with 'islands keys "
            "create --scope read --scope write', or serve on 127.0.0.1"
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
                f"{settings.tls_certificate} and {settings.tls_key} are no certificate with its key "
                f"({error}): give two PEM files that belong together"
            ) from error


def listening(host: str, port: int) -> socket.socket:
    """Return a socket that accepts connections.

    Raises
    ------
    SettingsError
        The address is not this machine's, or another program has the port.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    until = monotonic() + _TAKEN
    while True:
        try:
            return socket.create_server((host, port), family=family, backlog=_WAITING)
        except OSError as error:
            if error.errno == EADDRINUSE and monotonic() < until:
                sleep(0.05)
                continue
            why = "another program has it" if error.errno == EADDRINUSE else error.strerror
            raise SettingsError(
                f"cannot listen at {host}, port {port} ({why}): give another --port, or an address of this "
                "machine as --host"
            ) from error


if __name__ == "__main__":
    sys.exit(main())
