"""``python -m islands_service.runtime.ray_head``: the Ray on this machine, as a process of its own.

Coordinators connect to it by its address, as they do to a cluster: there is one path.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ray

from islands.errors import IslandsError
from islands_service.liveness import StopRequest, send_heartbeat, stop_on_signals
from islands_service.runtime.cluster import cluster
from islands_service.settings import service_settings

#: Seconds between two looks at whether Ray still answers.
_LOOK = 0.5

#: Processes of Ray that nothing goes on without.
_VITAL = ("gcs_server", "raylet")


def main() -> int:
    """Start Ray, say where it is, and stay until SIGTERM, or until Ray is lost."""
    settings = service_settings()
    stopping = StopRequest()
    stop_on_signals(stopping)
    try:
        with cluster(None):
            stop_on_signals(stopping)
            with _found_at(settings.ray_address_file):
                while not (lost := _lost()) and not stopping.wait(_LOOK):
                    # Here and not from a thread: where Ray hangs we do, too, and are started again.
                    send_heartbeat(settings.lifeline)
            if lost:
                print(f"Ray: {lost}", file=sys.stderr, flush=True)
                # Ray's own end would wait for who is lost; the supervisor ends whom we leave behind.
                os._exit(1)
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except IslandsError as error:
        print(f"Ray: {error}", file=sys.stderr)
        return 1
    return 0


def _lost() -> str:
    """Say what Ray has lost; "" where it goes on."""
    # Without its raylet Ray would answer as before, and carry out nothing.
    node = ray._private.worker._global_node
    if lost := [name for name, _ in node.dead_processes() if name in _VITAL]:
        return f"it has lost its {', '.join(lost)}"
    return "" if any(each["Alive"] for each in ray.nodes()) else "its raylet does not answer"


@contextmanager
def _found_at(path: Path) -> Iterator[None]:
    """Say in a file where Ray is, as long as the block lasts."""
    address = ray.get_runtime_context().gcs_address
    part = path.with_suffix(".part")
    part.write_text(address)
    part.replace(path)
    try:
        yield
    finally:
        # The next service on the same folder may have another Ray by now, and say where that is.
        if path.exists() and path.read_text() == address:
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
