"""TCP proxy before a server on this machine that delays, cuts and withholds what passes through it."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Bytes that are forwarded at once.
_CHUNK = 65536


class TCPProxy:
    """Proxy from a free port of 127.0.0.1 to a Unix socket.

    Attributes
    ----------
    port : int
    delay : float
        Seconds by which each chunk is delayed, in both directions.
    cut_before, cut_after : bytes
        Text of a client at which its connection is cut: before it is forwarded, or after, so that only
        the answer is lost. Each cuts one connection and is then empty.
    cuts : int
        Number of connections that were cut.
    """

    def __init__(self, target: Path) -> None:
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=200)
        self.port: int = self._listener.getsockname()[1]
        self.delay, self.cut_before, self.cut_after, self.cuts = 0.0, b"", b"", 0
        self._open = threading.Event()
        self._open.set()
        self._pairs: set[tuple[socket.socket, socket.socket]] = set()
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    def withhold(self) -> None:
        """Forward nothing more, and keep all connections open: the network swallows every packet."""
        self._open.clear()

    def resume(self) -> None:
        """Forward everything again, also what was withheld."""
        self._open.set()

    def cut(self) -> int:
        """Cut all connections; return their number."""
        with self._lock:
            pairs = list(self._pairs)
        for pair in pairs:
            self._close(pair)
        return len(pairs)

    def close(self) -> None:
        self._listener.close()
        self.cut()
        self.resume()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            server = socket.socket(socket.AF_UNIX)
            try:
                server.connect(str(self._target))
            except OSError:
                client.close()
                server.close()
                continue
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            pair = client, server
            with self._lock:
                self._pairs.add(pair)
            for source, sink in (pair, pair[::-1]):
                arguments = pair, source, sink
                threading.Thread(target=self._pump, args=arguments, daemon=True).start()

    def _pump(
        self, pair: tuple[socket.socket, socket.socket], source: socket.socket, sink: socket.socket
    ) -> None:
        with suppress(OSError):
            while data := source.recv(_CHUNK):
                if self.delay:
                    time.sleep(self.delay)
                self._open.wait()
                if source is pair[0] and self._take("cut_before", data):
                    break
                last = source is pair[0] and self._take("cut_after", data)
                if last:
                    source.shutdown(socket.SHUT_RDWR)  # the answer is lost
                sink.sendall(data)
                if last:
                    time.sleep(0.05)  # until the server has read the data
                    break
        self._close(pair)

    def _take(self, name: str, data: bytes) -> bool:
        with self._lock:
            found = bool(getattr(self, name)) and getattr(self, name) in data
            if found:
                setattr(self, name, b"")
                self.cuts += 1
        return found

    def _close(self, pair: tuple[socket.socket, socket.socket]) -> None:
        with self._lock:
            self._pairs.discard(pair)
        for each in pair:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()


@contextmanager
def proxied(target: Path) -> Iterator[TCPProxy]:
    proxy = TCPProxy(target)
    try:
        yield proxy
    finally:
        proxy.close()
