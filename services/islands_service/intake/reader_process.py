"""Processes that read one untrusted file each, forked by a fork server: how they are started and ended."""

import asyncio
import atexit
import os
import signal
import socket
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from threading import Lock
from typing import IO, Self

from islands_service.intake.confined_process import ENVIRONMENT, REQUESTS, make_command
from islands_service.settings import read_simulation_environment, service_settings

#: Largest number of bytes of an exit status.
_MAX_STATUS = 16

#: What a fork server sends when it has started a process.
STARTED = b"."


class ReaderProcess:
    """Process that reads one file with limited resources. It is killed at the end of a ``with`` block.

    Parameters
    ----------
    control : socket
        Connection to the fork server, which sends `STARTED` and the exit status, and kills the process if it
        is closed.
    """

    def __init__(self, control: socket.socket) -> None:
        self._control, self._is_started = control, False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._control.close()

    def kill(self) -> None:
        """Kill the process; `wait` returns when it has ended."""
        with suppress(OSError):  # the fork server has ended, and with it the process
            self._control.shutdown(socket.SHUT_WR)

    def wait_start(self, seconds: float | None = None) -> None:
        """Wait until the process has started, or the server has ended. A new server takes seconds to start.

        Raises
        ------
        TimeoutError
        """
        if not self._is_started:
            self._control.settimeout(seconds)
            self._receive(len(STARTED))
            self._is_started = True

    def wait(self, seconds: float | None = None) -> int:
        """Wait for the end of the process; return its exit status, that of a killed one without the server.

        Parameters
        ----------
        seconds : float, optional
            Longest time from the start of the process.

        Raises
        ------
        TimeoutError
        """
        self.wait_start()
        self._control.settimeout(seconds)
        return _parse_status(self._receive(_MAX_STATUS))

    async def wait_start_async(self) -> None:
        """Wait as `wait_start` does without a limit, in an event loop."""
        if not self._is_started:
            await self._await_message()
            self._receive(len(STARTED))
            self._is_started = True

    async def wait_async(self) -> int:
        """Wait as `wait` does without a limit, in an event loop."""
        await self.wait_start_async()
        await self._await_message()
        return _parse_status(self._receive(_MAX_STATUS))

    async def _await_message(self) -> None:
        self._control.setblocking(False)
        readable = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_reader(self._control, readable.set)
        try:
            await readable.wait()
        finally:
            loop.remove_reader(self._control)

    def _receive(self, size: int) -> bytes:
        try:
            return self._control.recv(size)
        except ConnectionResetError:
            return b""


def _parse_status(received: bytes) -> int:
    return int(received) if received else -signal.SIGKILL


class ForkServer:
    """Connection to a fork server: that of ``islands serve``, otherwise one that ends with this process.

    Parameters
    ----------
    command : sequence of str
        Command that starts a server.
    is_shared : bool
        Whether the server of ``islands serve`` runs the same programs.
    environment : callable
        Returns environment variables that the server needs.
    """

    def __init__(
        self,
        command: Sequence[str] = make_command("fork_server"),
        is_shared: bool = True,
        environment: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        self._command, self._is_shared, self._environment = command, is_shared, environment
        self._lock = Lock()
        self._requests: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def ensure_running(self) -> None:
        """Start the server unless it runs, so that the first file does not wait for its imports."""
        with self._lock:
            if self._requests is None:
                self._requests = self._connect()

    def start(self, program: str, message: bytes, output: int, errors: int) -> ReaderProcess:
        """Start a process.

        Parameters
        ----------
        program : str
            Key of the programs of the server, such as `islands_service.intake.fork_server.PROGRAMS`.
        message : bytes
            Standard input.
        output, errors : int
            File descriptors of standard output and standard error.
        """
        ours, theirs = socket.socketpair()
        with theirs, open_memory("message") as stream:
            stream.write(message)
            stream.flush()
            stream.seek(0)
            self._request(program, (theirs.fileno(), stream.fileno(), output, errors))
        return ReaderProcess(ours)

    def close(self) -> None:
        """End a server of this process, and its processes."""
        with self._lock:
            self._disconnect()

    def _request(self, program: str, descriptors: Sequence[int]) -> None:
        self.ensure_running()
        with self._lock:
            assert self._requests is not None
            try:
                socket.send_fds(self._requests, [program.encode()], descriptors)
            except (BrokenPipeError, ConnectionResetError):
                # The server of this process has ended. `islands serve` starts its own again.
                self._disconnect()
                self._requests = self._connect()
                socket.send_fds(self._requests, [program.encode()], descriptors)

    def _connect(self) -> socket.socket:
        shared = service_settings().readers if self._is_shared else None
        if shared is not None:
            return socket.socket(fileno=shared)
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                self._command,
                env={**self._environment(), **ENVIRONMENT, REQUESTS: str(theirs.fileno())},
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                # A Ctrl-C in the terminal must not reach it.
                start_new_session=True,
            )
        return ours

    def _disconnect(self) -> None:
        if self._requests is not None:
            self._requests.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._requests = self._process = None


def open_memory(name: str) -> IO[bytes]:
    """Open a file in memory, whose size the limits of a process bound, unlike that of a pipe."""
    return os.fdopen(os.memfd_create(name), "w+b")


#: Fork server of this process, for readers of files.
FORK_SERVER = ForkServer()

#: That for simulations, which needs the folder of the compiled kernels. It starts with the first simulation.
SIMULATION_SERVER = ForkServer(
    make_command("simulation_server"), is_shared=False, environment=read_simulation_environment
)

for _server in (FORK_SERVER, SIMULATION_SERVER):
    atexit.register(_server.close)
