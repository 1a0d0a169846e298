"""What Prometheus reads: requests as they come, and jobs as they stand when it looks."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from islands_service.store import Store


class ServiceMetrics:
    """The metrics of one application.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self.registry = CollectorRegistry()
        self.latency = Histogram(
            "islands_request_seconds",
            "Time until an answer began, by route.",
            ["method", "route", "status"],
            buckets=(0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 30.0),
            registry=self.registry,
        )
        self.accepted = Counter("islands_jobs_accepted", "Jobs accepted.", registry=self.registry)
        self.received = Counter(
            "islands_dataset_bytes_received", "Bytes of data sets received.", registry=self.registry
        )
        self.streams = Gauge("islands_event_streams", "Event streams that are open.", registry=self.registry)
        self.registry.register(_Jobs(store))

    def page(self) -> bytes:
        """Return all in Prometheus' text form.

        Raises
        ------
        StoreUnavailableError
        """
        return generate_latest(self.registry)


class _Jobs(Collector):
    def __init__(self, store: Store) -> None:
        self._store = store

    def describe(self) -> Iterator[Metric]:
        """Name nothing: jobs are counted when somebody looks, not when this is registered."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Read how the jobs stand."""
        standing = self._store.jobs.queue_statistics()
        jobs = GaugeMetricFamily("islands_jobs", "Jobs by state.", labels=["state"])
        for state, count in standing.counts.items():
            jobs.add_metric([state], count)
        yield jobs
        yield GaugeMetricFamily(
            "islands_queue_oldest_seconds", "How long the job that waits longest has.", standing.oldest
        )
        yield GaugeMetricFamily("islands_leases", "Leases that have not expired.", standing.leases)
        running = (
            ("islands_evaluations_per_second", "Individuals evaluated a second.", "evaluations_per_second"),
            ("islands_best_error", "RMSE of the best individual, in the output's unit.", "best_error"),
            ("islands_generation", "Generation that is complete.", "generation"),
        )
        for name, text, field in running:
            family = GaugeMetricFamily(name, f"{text} Of running jobs.", labels=["job"])
            for job, progress in standing.running.items():
                if progress.get(field) is not None:
                    family.add_metric([job], progress[field])
            yield family
