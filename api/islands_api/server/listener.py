"""Listening socket of the web server."""

import socket
from errno import EADDRINUSE
from time import monotonic, sleep

from islands.errors import SettingsError

#: Seconds for which a port in use is tried again: its previous owner may be shutting down.
_PORT_RETRY_SECONDS = 2.0

#: Length of the queue of connections that wait to be accepted.
_BACKLOG = 2048


def open_listener(host: str, port: int) -> socket.socket:
    """Open a listening TCP socket.

    Raises
    ------
    SettingsError
        The address does not belong to this machine, or another program uses the port.
    """
    deadline = monotonic() + _PORT_RETRY_SECONDS
    while True:
        try:
            return _listen(host, port)
        except OSError as error:
            if error.errno == EADDRINUSE and monotonic() < deadline:
                sleep(0.05)
                continue
            reason = "another program uses it" if error.errno == EADDRINUSE else error.strerror
            raise SettingsError(
                f"cannot listen at {host}, port {port} ({reason}): give another --port, or an "
                "address of this machine as --host"
            ) from error


def _listen(host: str, port: int) -> socket.socket:
    # `socket.create_server` leaves the protocol number at 0. asyncio sets TCP_NODELAY only on sockets whose
    # protocol is IPPROTO_TCP. Without it every response on a kept connection is delayed by some 40 ms:
    # Nagle's algorithm waits for the acknowledgement of the headers, which the client delays.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind((host, port))
        listener.listen(_BACKLOG)
    except BaseException:
        listener.close()
        raise
    return listener
