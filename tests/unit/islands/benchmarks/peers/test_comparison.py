"""Rows of a peer: errors of its simulations, and reasons in place of them, with a real child process."""

import pytest

from islands.benchmarks.definition import BenchmarkData, BenchmarkTest
from islands.benchmarks.peers.comparison import compare_peer
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.peer_scripts import LEAST_SQUARES, SET, make_data, make_peer

#: A script with a candidate and the body of its fit.
SCRIPT = """
import numpy as np

def list_candidates(task):
    return [{"number": 1}]

def fit(recordings, candidate, task):
"""


def run(folder, script, data=None, limit=60.0, **options):
    peer = make_peer(folder, script)
    (row,) = compare_peer("lag", SET, data or make_data(), peer, limit=limit, **options)
    return row


def test_the_error_is_that_of_the_free_run_in_the_unit_of_the_set(tmp_path):
    """The offset of 2 mV is an error of each scored sample, and does not reach the simulation."""
    row = run(tmp_path, LEAST_SQUARES, make_data(offset=0.002))
    assert row.error == pytest.approx(2.0, rel=1e-6)
    assert (row.benchmark, row.test, row.metric, row.unit) == ("lag", "two", "RMSE", "mV")
    assert (row.peer, row.version, row.setting, row.reason) == ("tiny", "1.2", "A setting.", None)
    assert row.chosen == "lags 2"
    assert 0.0 < row.cpu_s < 60.0
    assert row.wall_s > 0.0


def test_a_child_that_fails_has_its_message_as_the_reason(tmp_path):
    row = run(tmp_path, SCRIPT + "    raise ValueError('the matrix is singular')")
    assert row.error is None
    assert row.reason.endswith("the last one because: ValueError: the matrix is singular")
    assert row.cpu_s > 0.0
    assert "No module named 'absent'" in run(tmp_path, "import absent").reason


def test_a_signal_that_ends_a_child_is_the_reason(tmp_path):
    program = "import os\nprint('progress', flush=True)\nos.kill(os.getpid(), 9)"
    assert run(tmp_path, program).reason == "signal 9 has ended it, perhaps because memory was full"


@pytest.mark.parametrize("value", ["np.nan", "1e20"])
def test_a_simulation_that_diverges_on_the_test_has_no_error(tmp_path, value):
    diverging = f"""
    def simulate(u, y):
        return np.full((len(u), 1), {value} if len(u) == 50 else 0.0)

    return simulate
"""
    row = run(tmp_path, SCRIPT + diverging)
    assert row.error is None
    assert row.reason == "the free run diverges"


@pytest.mark.ci
def test_a_child_that_exceeds_its_cpu_limit_is_ended(tmp_path):
    row = run(tmp_path, SCRIPT + "    while True:\n        pass", limit=1.0)
    assert row.reason == "it exceeds the limit of 1 s of CPU"
    assert 0.5 < row.cpu_s < 3.0


def test_a_child_that_waits_is_ended_after_a_multiple_of_its_limit(tmp_path):
    row = run(tmp_path, "import time\ntime.sleep(100)", limit=0.1)
    assert row.reason == "it exceeds 1 s, 10 times the limit of CPU seconds"
    assert row.wall_s < 50.0


def test_a_stop_ends_the_child_without_rows(tmp_path):
    peer = make_peer(tmp_path, "import time\ntime.sleep(100)")
    assert compare_peer("lag", SET, make_data(), peer, stop=lambda: True) == []


def test_a_peer_of_one_output_has_a_reason_for_several(tmp_path):
    record = make_coupled_record(TWO_MASSES, 200)
    data = BenchmarkData(record, {"two": BenchmarkTest(record, 10, 10)})
    peer = make_peer(tmp_path, LEAST_SQUARES, reads_several_outputs=False)
    (row,) = compare_peer("masses", SET, data, peer)
    assert (row.error, row.reason, row.cpu_s) == (None, "tiny has models of one output only", 0.0)
    (row,) = compare_peer("masses", SET, data, make_peer(tmp_path, LEAST_SQUARES))
    assert row.error is not None


def test_the_progress_has_the_seconds_of_the_run(tmp_path):
    messages = []
    run(tmp_path, LEAST_SQUARES, progress=lambda message, fraction: messages.append((message, fraction)))
    assert messages[0] == ("0 s", pytest.approx(0.002, abs=0.002))
