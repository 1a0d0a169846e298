"""Prometheus metrics: requests as they arrive, and the state of all jobs at each scrape."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from islands_service.store import Store


class ServiceMetrics:
    """Metrics of one application.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self.registry = CollectorRegistry()
        self.latency = Histogram(
            "islands_request_seconds",
            "Time until the response started, by route.",
            ["method", "route", "status"],
            buckets=(0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 30.0),
            registry=self.registry,
        )
        self.accepted = Counter("islands_jobs_accepted", "Jobs accepted.", registry=self.registry)
        self.received = Counter(
            "islands_dataset_bytes_received", "Bytes of data sets received.", registry=self.registry
        )
        self.streams = Gauge("islands_event_streams", "Open event streams.", registry=self.registry)
        self.registry.register(_JobCollector(store))

    def page(self) -> bytes:
        """Return all metrics in the text format of Prometheus.

        Raises
        ------
        StoreUnavailableError
        """
        return generate_latest(self.registry)


class _JobCollector(Collector):
    def __init__(self, store: Store) -> None:
        self._store = store

    def describe(self) -> Iterator[Metric]:
        """Describe no metrics, so that registration does not query the database."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Query the state of the jobs."""
        statistics = self._store.jobs.queue_statistics()
        jobs = GaugeMetricFamily("islands_jobs", "Jobs by state.", labels=["state"])
        for state, count in statistics.counts.items():
            jobs.add_metric([state], count)
        yield jobs
        yield GaugeMetricFamily(
            "islands_queue_oldest_seconds", "Waiting time of the oldest queued job.", statistics.oldest
        )
        yield GaugeMetricFamily("islands_leases", "Leases that have not expired.", statistics.leases)
        running = (
            ("islands_evaluations_per_second", "Individuals evaluated per second.", "evaluations_per_second"),
            ("islands_best_error", "RMSE of the best individual, in the output's unit.", "best_error"),
            ("islands_generation", "Last complete generation.", "generation"),
        )
        for name, text, field in running:
            family = GaugeMetricFamily(name, f"{text} Of running jobs.", labels=["job"])
            for job, progress in statistics.running.items():
                if progress.get(field) is not None:
                    family.add_metric([job], progress[field])
            yield family
