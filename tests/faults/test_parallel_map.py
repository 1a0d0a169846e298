"""Parallel map on Ray: an error of the check ends the calls that are running."""

import os
import time

import pytest

from islands.available_cpus import count_cpus
from islands_service.runtime.cluster import cluster
from islands_service.runtime.parallel_map import ray_map
from support.processes import alive, eventually


class StopError(Exception):
    pass


@pytest.mark.ci
def test_error_of_the_check_ends_running_and_waiting_calls(ray_address, tmp_path):
    files = [tmp_path / str(number) for number in range(5)]

    # A nested function is sent with its code: workers cannot import this module.
    def compute_for_ever(path):
        draft = path.with_suffix(".draft")
        draft.write_text(str(os.getpid()))
        draft.rename(path)  # a file that exists has its content
        return sum(iter(int, 1))  # does not return to the interpreter

    def check():
        if any(file.exists() for file in files):
            raise StopError

    with cluster(ray_address):
        with pytest.raises(StopError):
            list(ray_map(check=check)(compute_for_ever, files))
        began = time.monotonic()
        eventually(lambda: not alive(int(file.read_text()) for file in files if file.exists()))
        time.sleep(0.5)
        started = [file for file in files if file.exists()]
    assert time.monotonic() - began < 10.0
    assert len(started) <= count_cpus()
    assert not alive(int(file.read_text()) for file in started)
