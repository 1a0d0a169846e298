"""``python -m islands_service.coordinator``: run a coordinator, alone or under ``islands serve``."""

import argparse
import os
import secrets
import signal
import socket
import sys
from functools import partial

from islands.errors import IslandsError
from islands.processes import limit_threads
from islands_service.coordinator.heartbeat import restart_process
from islands_service.coordinator.main_loop import Coordinator
from islands_service.coordinator.metrics import CoordinatorMetrics
from islands_service.liveness import (
    FAILED,
    MISCONFIGURED,
    UNAVAILABLE,
    StopRequest,
    stop_on_signals,
    watch_supervisor,
)
from islands_service.logs import configure_logs
from islands_service.runtime import ClusterError
from islands_service.settings import service_settings
from islands_service.store.database import DatabaseDamagedError, StoreError
from islands_service.telemetry import serve_metrics


def main() -> int:
    """Run until SIGTERM or SIGINT. After jobs, a new process takes the place of this one."""
    limit_threads()  # NumPy is not imported yet
    parser = argparse.ArgumentParser(prog="python -m islands_service.coordinator", description=__doc__)
    parser.add_argument(
        "--name", default=f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(3)}", help="unique"
    )
    parser.add_argument(
        "--metrics-port", type=int, help="port of the metrics; ISLANDS_METRICS_PORT by default"
    )
    arguments = parser.parse_args()
    stopping = StopRequest()
    try:
        settings = service_settings()
        configure_logs(settings.log_format, "coordinator")
        stop_on_signals(stopping)
        metrics = CoordinatorMetrics()
        if port := arguments.metrics_port or settings.metrics_port:
            serve_metrics(metrics.registry, settings.metrics_host, port)
            metrics.is_served = True
        inherited = settings.lifeline, settings.readers
        with watch_supervisor(settings.lifeline) as heartbeats:
            abandon = partial(restart_process, *inherited)
            demand = heartbeats.demand_roles
            Coordinator(settings, arguments.name, stopping, abandon, metrics, demand).run()
        # From here on a signal ends the process.
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        if not stopping.requested:
            restart_process(*inherited)
    except IslandsError as error:
        print(f"coordinator: {error}", file=sys.stderr)
        if isinstance(error, DatabaseDamagedError):
            return MISCONFIGURED
        # The store and Ray are other processes, which may come back.
        return UNAVAILABLE if isinstance(error, StoreError | ClusterError) else FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main())
