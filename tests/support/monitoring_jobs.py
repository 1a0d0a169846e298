"""Monitoring jobs in this process: records are submitted over REST, and analysed without Ray."""

from pathlib import Path

from islands.records.dataset import Dataset
from islands.records.writer import write_record
from islands_service.coordinator.monitoring_job import run_monitoring_job
from islands_service.domain.job import JobOutcome
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.monitored_oscillator import SIMULATION
from support.service import Service

#: Body of a monitor of the records of `monitored_oscillator`.
OSCILLATOR = {
    "simulation": SIMULATION,
    "input": "F",
    "output": "x",
    "false_alarms": "1 per 720 records",
    "training": 16,
}


def write_records(records: tuple[Dataset, ...], folder: Path) -> list[Path]:
    """Write records as text files."""
    paths = [folder / f"hour-{index}.csv" for index in range(len(records))]
    for record, path in zip(records, paths, strict=True):
        write_record(record, path)
    return paths


def analyse_next(service: Service) -> JobOutcome:
    """Claim the next record, analyse it and store the outcome."""
    lease = service.store.leases.claim("test", 600.0)
    assert lease is not None
    blobs = Blobs(service.settings.blobs)
    outcome = run_monitoring_job(make_run(lease, service.store, blobs))
    service.store.leases.finish(lease, outcome)
    return outcome
