"""Records of an oscillator that is monitored, and its monitor before a change."""

from functools import cache

import numpy as np

from islands.facade.record_monitor import create_monitor, monitor_record
from islands.records.dataset import Dataset
from islands.report.documents.monitor_state import SavedMonitor
from lab.diagnosis.monitor import SIMULATION, make_record

__all__ = ["ONSET", "SIMULATION", "TRAINING", "follow", "make_records", "undisturbed_monitor"]

#: Number of records of the training, and before a change.
TRAINING, ONSET = 16, 24


@cache
def make_records(count: int, **change: float) -> tuple[Dataset, ...]:
    """Return records of an oscillator; from `ONSET` on, parameters of `make_record` have other values."""
    rng = np.random.default_rng(3)
    return tuple(make_record(rng, 0.0, **(change if index >= ONSET else {})) for index in range(count))


def follow(records: tuple[Dataset, ...], saved: SavedMonitor | None = None) -> SavedMonitor:
    """Return a monitor after further records; without a monitor, a new one."""
    for record in records:
        saved = saved or create_monitor(
            record, SIMULATION, false_alarms="1 per 720 records", training=TRAINING
        )
        index = saved.state.count
        time = f"2026-11-{1 + index // 24:02d}T{index % 24:02d}:00:00"
        saved = monitor_record(saved, record, f"record {index}", time)
    assert saved is not None
    return saved


@cache
def undisturbed_monitor() -> SavedMonitor:
    """Return the monitor of the records before a change."""
    return follow(make_records(ONSET))
