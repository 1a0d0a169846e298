"""Prometheus metrics of a coordinator: attempts, outcomes, islands, and the time of durable writes."""

from collections.abc import Iterator
from math import inf
from time import monotonic

from prometheus_client import Counter, Gauge, Histogram, Metric
from prometheus_client.registry import Collector

from islands_service.telemetry import (
    WRITE_BUCKETS,
    make_commit_histogram,
    make_object_observer,
    make_registry,
)


class CoordinatorMetrics(Collector):
    """Metrics of one coordinator, since the start of its process.

    Attributes
    ----------
    registry : CollectorRegistry
    attempts : Counter
        Claimed jobs by kind.
    finished : Counter
        Stored outcomes by kind and state.
    given_back : Counter
        Attempts without an outcome by reason.
    running : Gauge
        Whether a job runs.
    running_islands, pending_islands : Gauge
        Islands of the running search with and without a separate CPU. Their sum is the number of its islands.
        A pending island shares the CPU of another one, or the search has not begun. Both are zero without a
        search, for example during a diagnosis.
    commits, blob_writes : Histogram
        Seconds of transactions, and of blobs until they are on the disk. A checkpoint is one of each.
    observe_object : callable
        See `make_object_observer`.
    is_served : bool
        Whether Prometheus can read the metrics.
    """

    def __init__(self) -> None:
        self.registry = make_registry("coordinator")
        self.is_served, self._read_at = False, -inf
        self.registry.register(self)
        self.attempts = Counter(
            "islands_attempts", "Jobs claimed by this coordinator.", ["kind"], registry=self.registry
        )
        self.finished = Counter(
            "islands_jobs_finished",
            "Jobs that ended in this coordinator.",
            ["kind", "state"],
            registry=self.registry,
        )
        self.given_back = Counter(
            "islands_attempts_given_back",
            "Attempts without an outcome: lease-lost, stopping, turn-over, declined, interrupted, store, "
            "object-store, cluster.",
            ["reason"],
            registry=self.registry,
        )
        self.running = Gauge(
            "islands_coordinator_busy", "1 while a job runs in this coordinator.", registry=self.registry
        )
        self.running_islands = Gauge(
            "islands_running_islands",
            "Islands of the running search that have a separate CPU.",
            registry=self.registry,
        )
        self.pending_islands = Gauge(
            "islands_pending_islands",
            "Islands of the running search without a separate CPU: as many more CPUs would be used.",
            registry=self.registry,
        )
        self.commits = make_commit_histogram(self.registry)
        self.blob_writes = Histogram(
            "islands_blob_write_seconds",
            "Time until a blob, for example a checkpoint, is on the disk.",
            buckets=WRITE_BUCKETS,
            registry=self.registry,
        )
        self.observe_object = make_object_observer(self.registry)

    def collect(self) -> Iterator[Metric]:
        """Note that the metrics are being read; called by the registry, which has them."""
        self._read_at = monotonic()
        return iter(())

    def are_read_since(self, begin: float) -> bool:
        """Return whether the end of this process would lose no count that has changed before a time."""
        return self._read_at > begin or not self.is_served

    def observe_islands(self, running: int, pending: int) -> None:
        """Set the numbers of islands with and without a separate CPU."""
        self.running_islands.set(running)
        self.pending_islands.set(pending)
