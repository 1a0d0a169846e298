"""Prometheus metrics: requests as they arrive, and the state of all jobs at each scrape."""

import collections
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from prometheus_client import Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from islands_service.domain.job import JobState
from islands_service.store import Store
from islands_service.telemetry import make_commit_histogram, make_object_observer, make_registry

#: Largest number of owners with metrics of their jobs: each is a time series.
MAX_OWNERS = 50


class ServiceMetrics:
    """Metrics of one application.

    Parameters
    ----------
    store : Store
    folder : Path
        Data folder, whose disk is measured.
    """

    def __init__(self, store: Store, folder: Path) -> None:
        self.registry = make_registry("api")
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
        self._deliveries = Histogram(
            "islands_webhook_delivery_seconds",
            "Time of an attempt to deliver an event: delivered, retried (repeated later), failed (the last).",
            ["outcome"],
            buckets=(0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 15.0),
            registry=self.registry,
        )
        store.database.observe_commit = make_commit_histogram(self.registry).observe
        self.observe_object = make_object_observer(self.registry)
        self.registry.register(_JobCollector(store))
        self.registry.register(_DiskCollector(folder))

    def observe_delivery(self, outcome: str, seconds: float) -> None:
        """Count an attempt to deliver an event to a webhook."""
        self._deliveries.labels(outcome).observe(seconds)

    def page(self) -> bytes:
        """Return all metrics in the text format of Prometheus.

        Raises
        ------
        StoreUnavailableError
        """
        return generate_latest(self.registry)


class _DiskCollector(Collector):
    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def collect(self) -> Iterator[Metric]:
        """Query the disk of the data folder."""
        disk = shutil.disk_usage(self._folder)
        yield GaugeMetricFamily("islands_disk_bytes", "Size of the disk of the data folder.", disk.total)
        yield GaugeMetricFamily(
            "islands_disk_free_bytes", "Free bytes on the disk of the data folder.", disk.free
        )


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
        active = GaugeMetricFamily(
            "islands_owner_jobs",
            f"Queued and running jobs of the {MAX_OWNERS} owners with most, and of all others.",
            labels=["owner", "state"],
        )
        for (owner, state), count in _combine_owners(statistics.active).items():
            active.add_metric([owner, state], count)
        yield active
        pending = self._store.deliveries.pending()
        yield GaugeMetricFamily(
            "islands_webhook_deliveries_pending",
            "Deliveries of webhooks to be sent or repeated.",
            pending.count,
        )
        yield GaugeMetricFamily(
            "islands_webhook_oldest_seconds", "Age of the oldest pending delivery.", pending.oldest
        )
        found = self._store.monitors.statistics()
        monitors = GaugeMetricFamily("islands_monitors", "Monitors by status.", labels=["status"])
        for status, count in found.counts.items():
            monitors.add_metric([status], count)
        yield monitors
        yield GaugeMetricFamily("islands_monitor_alarms", "Alarms of all monitors.", found.alarms)
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


def _combine_owners(counts: Mapping[tuple[str, JobState], int]) -> Mapping[tuple[str, JobState], int]:
    """Return the counts of the owners with the most jobs; the rest are combined under an empty name."""
    totals = collections.Counter[str]()
    for (owner, _), count in counts.items():
        totals[owner] += count
    shown = {owner for owner, _ in totals.most_common(MAX_OWNERS)}
    combined = collections.Counter[tuple[str, JobState]]()
    for (owner, state), count in counts.items():
        combined[owner if owner in shown else "", state] += count
    return combined
