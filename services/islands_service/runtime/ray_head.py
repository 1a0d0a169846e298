"""``python -m islands_service.runtime.ray_head``: run the Ray head of this machine in a separate process.

Coordinators connect to it by its address, in the same way as to an external cluster.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ray

from islands.errors import IslandsError
from islands_service.liveness import FAILED, StopRequest, send_heartbeat, stop_on_signals
from islands_service.runtime.cluster import cluster
from islands_service.settings import service_settings

#: Seconds between two checks of Ray.
_POLL_SECONDS = 0.5

#: Processes of Ray without which it cannot run anything.
_VITAL = ("gcs_server", "raylet")


def main() -> int:
    """Start Ray, publish its address, and run until SIGTERM or until Ray fails."""
    settings = service_settings()
    stopping = StopRequest()
    stop_on_signals(stopping)
    try:
        with cluster(None, jobs=max(1, settings.coordinators)):
            stop_on_signals(stopping)
            with _publish_address(settings.ray_address_file):
                while not (failure := _find_failure()) and not stopping.wait(_POLL_SECONDS):
                    # In this thread: if Ray hangs, the heartbeats end and the supervisor restarts this
                    # process.
                    send_heartbeat(settings.lifeline)
            if failure:
                print(f"Ray: {failure}", file=sys.stderr, flush=True)
                # A regular shutdown would wait for the lost process. The supervisor kills the remaining ones.
                os._exit(FAILED)
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except IslandsError as error:
        print(f"Ray: {error}", file=sys.stderr)
        return FAILED
    return 0


def _find_failure() -> str:
    """Return a message about a lost process of Ray; empty if all run."""
    # Without its raylet Ray would still answer, but run nothing.
    node = ray._private.worker._global_node
    if lost := [name for name, _ in node.dead_processes() if name in _VITAL]:
        return f"it has lost its {', '.join(lost)}"
    return "" if any(each["Alive"] for each in ray.nodes()) else "its raylet does not answer"


@contextmanager
def _publish_address(path: Path) -> Iterator[None]:
    """Write the address of Ray to a file, and remove the file after the block."""
    address = ray.get_runtime_context().gcs_address
    part = path.with_suffix(".part")
    part.write_text(address)
    part.replace(path)
    try:
        yield
    finally:
        # The next service on the same folder may have overwritten the file with the address of another Ray.
        if path.exists() and path.read_text() == address:
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
