"""Records of a monitor of a running service: each exactly once and in order, whatever is killed."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import islands
from islands.report.documents.monitor_state import SavedMonitor, monitor_to_json
from islands_api.client import Client
from support.monitored_oscillator import make_records
from support.monitoring_jobs import OSCILLATOR, write_records
from support.processes import eventually, kill
from support.service_processes import Service, serving

pytestmark = pytest.mark.nightly

#: Records, of which the last ones have play at the input.
UNDISTURBED, COUNT = 24, 28

#: Numbers of analysed records at which both coordinators, or the API, are killed.
KILLS = {2: "coordinator", 6: "api", 9: "coordinator", 13: "coordinator", 18: "api", 22: "coordinator"}


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with serving(tmp_path / "data", "--coordinators", 2) as running:
        yield running


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    return write_records(make_records(COUNT, play=0.5), tmp_path)


def follow_files(paths: list[Path]) -> SavedMonitor:
    """Return the monitor of the library after all records."""
    saved = None
    for path in paths:
        record = islands.read_record(path, inputs=["F"], output="x")
        saved = saved or islands.create_monitor(
            record,
            OSCILLATOR["simulation"],
            false_alarms=str(OSCILLATOR["false_alarms"]),
            training=int(str(OSCILLATOR["training"])),
        )
        saved = islands.monitor_record(saved, record, path.name)
    assert saved is not None
    return saved


def test_kills_neither_lose_nor_repeat_nor_reorder_records(service: Service, paths: list[Path]) -> None:
    expected = follow_files(paths)
    with Client(service.url, retry=60.0) as client:
        monitor = client.create_monitor(**OSCILLATOR)
        jobs = [client.add_record(monitor, client.upload(path)) for path in paths]
        for records, role in KILLS.items():
            eventually(lambda records=records: client.monitor(monitor).records >= records, seconds=120.0)
            service.one(role)
            for process in service.pids(role):
                kill(process)
        for job in jobs:
            client.wait(job, 120.0)
        found = client.monitor(monitor)
        assert (found.records, found.alarms, found.pending) == (COUNT, len(expected.state.alarms), 0)
        assert found.alarms > 0
        assert client.monitor_state(monitor) == monitor_to_json(expected)
