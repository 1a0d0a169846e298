"""Monitoring jobs in this process: records are submitted over REST, and analysed without Ray."""

from pathlib import Path

from islands.records.dataset import Dataset
from islands.records.writer import write_record
from support.monitored_oscillator import SIMULATION

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
