"""Prometheus metrics of every process: version, memory, CPU time and open files; and their endpoint."""

import platform
from collections.abc import Callable

from prometheus_client import CollectorRegistry, Histogram, Info, ProcessCollector, start_http_server

from islands.distribution import read_version
from islands.errors import SettingsError

#: Upper bounds in seconds of the buckets of durable writes.
WRITE_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 5.0)


def make_registry(role: str) -> CollectorRegistry:
    """Return a registry with the metrics of this process.

    Parameters
    ----------
    role : str
        ``api`` or ``coordinator``, a label of ``islands_build_info``.
    """
    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    build = Info("islands_build", "Version of islands and of Python.", registry=registry)
    build.info({"version": read_version(), "python": platform.python_version(), "role": role})
    return registry


def make_commit_histogram(registry: CollectorRegistry) -> Histogram:
    """Return the metric of the transactions of this process, for `Database.observe_commit`."""
    return Histogram(
        "islands_store_commit_seconds",
        "Time of a transaction of the store, which may contain several operations.",
        buckets=WRITE_BUCKETS,
        registry=registry,
    )


def make_object_observer(registry: CollectorRegistry) -> Callable[[str, str, float], None]:
    """Return a function that counts the operations of an object store, for `Blobs.observe_object`."""
    seconds = Histogram(
        "islands_object_store_seconds",
        "Time of a request to the object store, by operation and outcome: done, missing, refused, "
        "unavailable, failed.",
        ["operation", "outcome"],
        buckets=(*WRITE_BUCKETS, 30.0),
        registry=registry,
    )
    return lambda operation, outcome, took: seconds.labels(operation, outcome).observe(took)


def serve_metrics(registry: CollectorRegistry, host: str, port: int) -> None:
    """Serve the metrics of a process without a web interface from a background thread, at ``/metrics``.

    Raises
    ------
    SettingsError
        The address does not belong to this machine, or another program uses the port.
    """
    try:
        start_http_server(port, host, registry)
    except OSError as error:
        raise SettingsError(
            f"cannot serve metrics at {host}, port {port} ({error.strerror}): set ISLANDS_METRICS_HOST and "
            "ISLANDS_METRICS_PORT to a free port of this machine"
        ) from error
