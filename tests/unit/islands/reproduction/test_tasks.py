"""Tasks of a reproduction: each runs once, and an interrupted run ends with the results of a whole one."""

import json
from functools import partial
from pathlib import Path

import pytest

from islands.errors import SettingsError
from islands.processes.pool import process_pool
from islands.progress import StoppedError
from islands.reproduction import tasks
from islands.reproduction.tasks import ReproductionOptions, Task, run_tasks


def count_and_divide(folder: str, number: int) -> dict:
    """Record the call in a file, so that calls in other processes are counted too."""
    with Path(folder, "calls").open("a") as stream:
        stream.write(f"{number}\n")
    return {"third": number / 3, "pair": (number, 0.1)}


def fail(_folder: str, number: int) -> dict:
    raise ArithmeticError(number)


def not_a_number() -> dict:
    return {"error": float("nan")}


@pytest.fixture
def planned(tmp_path):
    return [Task(f"task-{number}", count_and_divide, (str(tmp_path), number)) for number in range(4)]


def calls(tmp_path) -> list[str]:
    return (tmp_path / "calls").read_text().split()


def stop_before(last: int, function, arguments):
    """Map that a stop request ends after some calls."""
    for number, argument in enumerate(arguments):
        if number == last:
            raise StoppedError("the rest")
        yield function(argument)


def test_an_interrupted_run_continues_with_the_same_bytes(tmp_path, planned):
    whole = run_tasks(planned, tmp_path / "whole")
    (tmp_path / "calls").unlink()
    with pytest.raises(StoppedError):
        run_tasks(planned, tmp_path / "resumed", partial(stop_before, 2))
    resumed = run_tasks(planned, tmp_path / "resumed")
    assert calls(tmp_path) == ["0", "1", "2", "3"]
    assert json.dumps(resumed) == json.dumps(whole)
    files = [sorted((tmp_path / name).iterdir()) for name in ("whole", "resumed")]
    assert [path.read_bytes() for path in files[0]] == [path.read_bytes() for path in files[1]]


def test_a_fresh_result_equals_the_stored_one(tmp_path, planned):
    assert run_tasks(planned, tmp_path) == run_tasks(planned, tmp_path)
    assert run_tasks(planned, tmp_path)["task-1"] == {"third": 1 / 3, "pair": [1, 0.1]}


def test_a_result_is_stored_although_a_later_task_fails(tmp_path, planned):
    with pytest.raises(ArithmeticError):
        run_tasks([planned[0], Task("failing", fail, (str(tmp_path), 1))], tmp_path)
    run_tasks(planned[:1], tmp_path)
    assert calls(tmp_path) == ["0"]


@pytest.mark.ci
def test_results_of_other_processes_are_the_same(tmp_path, planned):
    with process_pool(2, start_after=0.0) as parallel_map:
        parallel = run_tasks(planned, tmp_path / "parallel", parallel_map)
    assert parallel == run_tasks(planned, tmp_path / "serial")


def test_changed_arguments_and_changed_sources_run_a_task_again(tmp_path, planned, monkeypatch):
    run_tasks(planned[:1], tmp_path)
    run_tasks([Task("task-0", count_and_divide, (str(tmp_path), 7))], tmp_path)
    assert calls(tmp_path) == ["0", "7"]
    monkeypatch.setattr(tasks, "_hash_sources", lambda: "other sources")
    run_tasks([Task("task-0", count_and_divide, (str(tmp_path), 7))], tmp_path)
    assert calls(tmp_path) == ["0", "7", "7"]


@pytest.mark.parametrize("damaged", ["", "{", "[]", "{}", '{"fingerprint": 1}'])
def test_a_damaged_file_is_computed_again(tmp_path, planned, damaged):
    first = run_tasks(planned[:1], tmp_path)
    (tmp_path / "task-0.json").write_text(damaged)
    assert run_tasks(planned[:1], tmp_path) == first
    assert calls(tmp_path) == ["0", "0"]


def test_progress_counts_all_tasks_and_the_fraction_of_those_that_run(tmp_path, planned):
    run_tasks(planned[:2], tmp_path)
    shown = []
    run_tasks(planned, tmp_path, report=lambda message, fraction=None, /: shown.append((message, fraction)))
    assert shown == [("2 of 4 tasks", 0.0), ("3 of 4 tasks", 0.5), ("4 of 4 tasks", 1.0)]


def test_results_are_in_the_order_of_the_tasks_also_after_a_resumption(tmp_path, planned):
    run_tasks(planned[2:3], tmp_path)
    assert list(run_tasks(planned, tmp_path)) == [task.key for task in planned]


def test_equal_keys_are_refused(tmp_path, planned):
    with pytest.raises(SettingsError, match="different keys"):
        run_tasks([planned[0], planned[0]], tmp_path)


def test_a_result_has_no_nan_which_json_does_not_know(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        run_tasks([Task("nan", not_a_number)], tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["seeds", "runs"])
def test_options_have_at_least_one_run(name):
    with pytest.raises(SettingsError, match=f"{name} is at least 1"):
        ReproductionOptions(**{name: 0})
