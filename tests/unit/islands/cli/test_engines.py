"""Ray is used where it starts; a search for which it was not chosen does not depend on it."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from islands.cli.engines import start_engine
from islands.errors import EngineError
from islands.evolution.engine import SerialEngine
from islands.records.writer import write_record
from support.identify_runs import COLUMNS, STEPWISE, record
from support.processes import descendants


@pytest.fixture
def failing_ray(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let Ray fail after the start of its first process; it leaves neither a process nor a file."""
    prefix = f"islands-ray-{os.getpid()}-"
    monkeypatch.setattr("islands_service.runtime.cluster._PREFIX", prefix)
    monkeypatch.setenv("RAY_OVERRIDE_RESOURCES", "{")
    before = descendants(os.getpid()).keys()
    yield
    assert not list(Path("/tmp").glob(f"{prefix}*"))
    started = {pid: line for pid, line in descendants(os.getpid()).items() if pid not in before}
    assert not [line for line in started.values() if "gcs_server" in line]


@pytest.mark.parametrize(
    ("islands", "is_installed", "name"), [(1, True, None), (2, False, None), (2, True, "serial")]
)
def test_one_island_the_serial_engine_and_a_machine_without_ray_use_one_core(
    islands, is_installed, name, monkeypatch
):
    monkeypatch.setattr("islands.cli.engines.has_ray", lambda: is_installed)
    messages = []
    with start_engine(name, None, islands, messages.append) as engine:
        assert isinstance(engine, SerialEngine)
    assert ["extra 'ray'" in line for line in messages] == [True] * (not is_installed)


@pytest.mark.ci
def test_a_search_goes_on_with_the_same_result_where_ray_does_not_start(failing_ray, tmp_path, command_line):
    write_record(record(), tmp_path / "r.csv")
    search = ("identify", "r.csv", *COLUMNS, *STEPWISE, "--islands", 2, "--figures", "none")
    code, _, printed = command_line(*search, "--out", "default")
    assert code == 0, printed
    assert "engine: serial, on one core, with the same result; Ray does not start" in " ".join(
        printed.split()
    )
    code, _, printed = command_line(*search, "--out", "serial", "--engine", "serial")
    assert (code, "Ray" in printed) == (0, False)
    halls = [(tmp_path / each / "hall.json").read_bytes() for each in ("default", "serial")]
    assert halls[0] == halls[1]
    code, _, printed = command_line(*search, "--out", "ray", "--engine", "ray")
    assert code == 2
    assert "error: Ray does not start on this machine" in printed


def test_an_address_was_given_for_a_reason():
    with pytest.raises(EngineError, match="no Ray cluster answers"), start_engine(None, "nowhere", 2, print):
        pass
