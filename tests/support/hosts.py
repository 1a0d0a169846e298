"""Hosts of a network for tests: network namespaces, each with its processes, that can be cut off."""

import ctypes
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from secrets import token_hex

import pytest

from support.processes import alive, descendants

#: Reason for skipping a test without network namespaces.
NO_NAMESPACES = "network namespaces need root and the command ip (Debian: apt install iproute2)"

#: Flag of setns: the file descriptor is that of a network namespace.
_CLONE_NEWNET = 0x40000000


class Host:
    """A network namespace with one address, and the processes that were started in it.

    Attributes
    ----------
    address : str
    """

    def __init__(self, network: str, number: int) -> None:
        self.address = f"10.213.7.{number}"
        self._name, self._switch, self._port = f"{network}-{number}", f"{network}-0", f"port{number}"
        self._processes: list[subprocess.Popen[bytes]] = []
        _ip("netns", "add", self._name)
        peer = ("peer", "name", "eth0", "netns", self._name)
        _ip("-n", self._switch, "link", "add", self._port, "type", "veth", *peer)
        _ip("-n", self._switch, "link", "set", self._port, "master", "bridge", "up")
        _ip("-n", self._name, "address", "add", f"{self.address}/24", "dev", "eth0")
        for device in ("lo", "eth0"):
            _ip("-n", self._name, "link", "set", device, "up")

    def connect(self, connected: bool) -> None:
        """Connect the host to the network, or cut it off: no packet gets through, and none is refused."""
        _ip(
            "-n",
            self._switch,
            "link",
            "set",
            self._port,
            *(("master", "bridge") if connected else ("nomaster",)),
        )

    def start(self, command: Sequence[str], environment: Mapping[str, str], log: Path) -> None:
        with log.open("ab") as stream:
            self._processes.append(
                subprocess.Popen(
                    ["ip", "netns", "exec", self._name, *command],
                    env={**os.environ, **environment},
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=stream,
                    start_new_session=True,
                )
            )

    def running(self) -> list[int]:
        """Return the processes of the host, whatever has started them."""
        done = subprocess.run(
            ["ip", "netns", "pids", self._name], capture_output=True, text=True, check=False
        )
        return alive(map(int, done.stdout.split()))

    def lose(self) -> None:
        """Kill all started processes and their descendants at once, as a power failure does."""
        roots = [process.pid for process in self._processes]
        _kill([*roots, *(pid for root in roots for pid in descendants(root))])
        for process in self._processes:
            process.wait(10)
        self._processes.clear()

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Run the block of this thread, and the processes that it starts, in the network of the host."""
        with Path("/proc/thread-self/ns/net").open() as own, Path(f"/run/netns/{self._name}").open() as other:
            _enter(other.fileno())
            try:
                yield
            finally:
                _enter(own.fileno())

    def remove(self) -> None:
        self.lose()
        _kill(self.running())
        _ip("netns", "delete", self._name)


@contextmanager
def hosts(count: int) -> Iterator[list[Host]]:
    """Provide hosts in a separate network; skip the test if that is impossible."""
    if os.getuid() != 0 or shutil.which("ip") is None:
        pytest.skip(NO_NAMESPACES)
    network = f"islands-{token_hex(3)}"
    switch = f"{network}-0"
    done = subprocess.run(["ip", "netns", "add", switch], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"{NO_NAMESPACES}: {done.stderr.strip()}")
    with ExitStack() as stack:
        stack.callback(_ip, "netns", "delete", switch)
        _ip("-n", switch, "link", "add", "bridge", "type", "bridge")
        _ip("-n", switch, "link", "set", "bridge", "up")
        made = []
        for number in range(1, count + 1):
            made.append(Host(network, number))
            stack.callback(made[-1].remove)
        yield made


def _kill(pids: list[int]) -> None:
    for number in (signal.SIGSTOP, signal.SIGKILL):
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, number)


def _enter(descriptor: int) -> None:
    if ctypes.CDLL(None, use_errno=True).setns(descriptor, _CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns failed")


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
