"""Pool of processes: functions, errors, signals and ends of its processes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from multiprocessing import active_children
from pathlib import Path

import pytest

from islands import available_cpus
from islands import process_pool as pool
from islands.process_pool import ProcessPoolError, process_pool
from islands.progress import StoppedError
from support.processes import alive, descendants, eventually

CODE = """
from multiprocessing import get_context
from signal import SIG_BLOCK, SIGINT, pthread_sigmask
from islands.process_pool import block_sigint

process = get_context("spawn").Process(target=print)  # the first process, which starts the resource tracker
with block_sigint():
    process.start()
    status = open(f"/proc/{process.pid}/status").read()
process.join()
blocked = int(status.partition("SigBlk:")[2].split()[0], 16)
print(bool(blocked & 1 << SIGINT - 1), SIGINT in pthread_sigmask(SIG_BLOCK, ()))
"""

pytestmark = pytest.mark.ci


def test_process_starts_with_sigint_blocked() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["True", "False"]


@pytest.fixture(scope="module", autouse=True)
def _light_processes() -> Iterator[None]:
    """Let the fork server import nothing in advance: the functions need no module of the library."""
    pool._end_server()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "_PRELOADED", [])
        yield
    pool._end_server()


def test_pool_evaluates_local_functions_in_other_processes_in_order() -> None:
    factor = 3

    def multiply(number: int) -> tuple[int, int]:
        return factor * number, os.getpid()

    with process_pool(2, start_after=0.0) as parallel_map:
        products, processes = zip(*parallel_map(multiply, range(20)), strict=True)
        again = [product for product, _ in parallel_map(multiply, [5])]
        # Results may contain functions without a name.
        doubled = list(parallel_map(lambda factor: lambda value: factor * value, [1, 2, 3]))
    assert [function(2) for function in doubled] == [2, 4, 6]
    assert (list(products), again) == ([factor * number for number in range(20)], [15])
    assert os.getpid() not in processes
    assert len(set(processes)) <= 2


def test_quota_of_a_container_bounds_the_number_of_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cpu.max").write_text("100000 100000\n")
    monkeypatch.setattr(available_cpus, "CGROUPS", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    with process_pool(start_after=0.0) as parallel_map:  # one core: no other process
        assert set(parallel_map(lambda _: os.getpid(), range(3))) == {os.getpid()}


def test_error_of_the_function_is_raised_and_ends_the_processes() -> None:
    def fail(number: int) -> int:
        if number == 3:
            raise ZeroDivisionError(number)
        return sum(iter(int, 1)) if number > 3 else number  # without an end

    others = set(active_children())
    with process_pool(2, start_after=0.0) as parallel_map:
        results = parallel_map(fail, range(10))
        assert next(results) == 0
        processes = set(active_children()) - others
        with pytest.raises(ZeroDivisionError):
            list(results)
    for process in processes:
        process.join(10.0)
    assert processes
    assert not any(process.is_alive() for process in processes)


def test_killed_process_is_an_error_that_says_what_to_do() -> None:
    def end(_: int) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    with (
        pytest.raises(ProcessPoolError, match="fewer workers"),
        process_pool(2, start_after=0.0) as parallel_map,
    ):
        list(parallel_map(end, range(2)))


def test_fork_server_starts_with_sigint_blocked_and_ends_at_an_error() -> None:
    """Ctrl-C in a terminal reaches it while it imports, and would end it with a traceback."""
    code = (
        "import os; from multiprocessing import forkserver; from pathlib import Path\n"
        "from islands.process_pool import process_pool\n"
        "try:\n"
        "    with process_pool(2):\n"
        "        server = forkserver._forkserver._forkserver_pid\n"
        "        status = Path(f'/proc/{server}/status').read_text()\n"
        "        raise KeyboardInterrupt\n"
        "except KeyboardInterrupt:\n"
        "    print(status.partition('SigBlk:')[2].split()[0], os.path.exists(f'/proc/{server}'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, timeout=60, capture_output=True, text=True
    )
    blocked, is_alive = done.stdout.split()
    assert int(blocked, 16) & 1 << signal.SIGINT - 1
    assert is_alive == "False"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_processes_end_with_the_one_that_started_them(number: signal.Signals) -> None:
    code = (
        "import time; from islands import process_pool; process_pool._PRELOADED = []\n"
        "with process_pool.process_pool(2, start_after=0.0) as parallel_map:\n"
        "    for seconds in parallel_map(lambda seconds: time.sleep(seconds) or seconds, (0.0, 0.0, 60.0)):\n"
        "        print(seconds, flush=True)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["0.0\n", "0.0\n"]
        others = descendants(process.pid)
        process.send_signal(number)
    assert len(others) >= 4  # the resource tracker, the server and two processes
    eventually(lambda: not alive(others), seconds=10.0)


@pytest.mark.parametrize("workers", [1, 2])
def test_check_ends_a_map_while_its_functions_compute(workers: int) -> None:
    checks: list[float] = []

    def check() -> None:
        checks.append(time.monotonic())
        if len(checks) > 2:
            raise StoppedError("the map")

    began = time.monotonic()
    with pytest.raises(StoppedError), process_pool(workers, start_after=0.0, check=check) as parallel:
        list(parallel(time.sleep, [0.05, 0.05, 60.0]))
    assert time.monotonic() - began < 30.0
