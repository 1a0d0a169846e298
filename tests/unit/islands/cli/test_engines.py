"""Ray is used where it starts; a search for which it was not chosen does not depend on it."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from islands.cli.engines import open_pool, start_engine
from islands.errors import EngineError
from islands.evolution.engine import SerialEngine
from islands.io.records import write_record
from support.identify_runs import COLUMNS, STEPWISE, record
from support.processes import descendants


@pytest.fixture
def failing_ray(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let Ray fail after the start of its first process; it leaves neither a process nor a file."""
    prefix = f"islands-ray-{os.getpid()}-"
    monkeypatch.setattr("islands_service.runtime.cluster._PREFIX", prefix)
    monkeypatch.setenv("RAY_OVERRIDE_RESOURCES", "{")
    yield
    assert not list(Path("/tmp").glob(f"{prefix}*"))
    assert not [line for line in descendants(os.getpid()).values() if "gcs_server" in line]


@pytest.mark.parametrize(
    ("islands", "is_installed", "name"), [(1, True, None), (2, False, None), (2, True, "serial")]
)
def test_a_search_runs_on_one_core_where_one_is_enough_or_chosen_or_ray_is_absent(
    islands, is_installed, name, monkeypatch
):
    monkeypatch.setattr("islands.cli.engines.has_ray", lambda: is_installed)
    told = []
    with start_engine(name, None, islands, told.append) as engine:
        assert isinstance(engine, SerialEngine)
    assert ["extra 'ray'" in line for line in told] == [True] * (not is_installed)


@pytest.mark.ci
def test_a_search_goes_on_with_the_same_result_where_ray_does_not_start(failing_ray, tmp_path, command_line):
    write_record(record(), tmp_path / "r.csv")
    search = ("identify", "r.csv", *COLUMNS, *STEPWISE, "--islands", 2, "--figures", "none")
    code, _, told = command_line(*search, "--out", "default")
    assert code == 0, told
    assert "engine: serial, on one core, with the same result; Ray does not start" in " ".join(told.split())
    code, _, told = command_line(*search, "--out", "serial", "--engine", "serial")
    assert (code, "Ray" in told) == (0, False)
    halls = [(tmp_path / each / "hall.json").read_bytes() for each in ("default", "serial")]
    assert halls[0] == halls[1]
    code, _, told = command_line(*search, "--out", "ray", "--engine", "ray")
    assert code == 2
    assert "error: Ray does not start on this machine" in told


@pytest.mark.ci
def test_tasks_run_on_processes_where_ray_does_not_start(failing_ray, capsys):
    with open_pool(2, None, lambda: None) as parallel_map:
        assert list(parallel_map(abs, [-1, 2, -3])) == [1, 2, 3]
    assert "processes in place of Ray" in capsys.readouterr().err


def test_an_address_was_given_for_a_reason():
    with pytest.raises(EngineError, match="no Ray cluster answers"), start_engine(None, "nowhere", 2, print):
        pass
