"""Child process of a peer: split of the data, choice of a candidate, lags, requests and answers."""

from itertools import count

import numpy as np
import pytest

from islands.benchmarks.peers import child
from islands.benchmarks.peers.child import PeerRecording, PeerTask


def recording(samples, start=0.0):
    """Return inputs 0, 1, ... and outputs 100, 101, ... from a start."""
    counted = start + np.arange(samples, dtype=float)[:, None]
    return PeerRecording(counted, 100.0 + counted)


def task(*recordings, known=3, limit=1e6):
    return PeerTask(recordings, known, limit)


def choose(candidates, fit, given):
    return child.choose({"list_candidates": lambda _task: candidates, "fit": fit}, given)


def repeat(value):
    return lambda u, _y: np.full((len(u), 1), value)


def test_the_last_quarter_of_each_recording_is_held_out_behind_initial_samples():
    fitted, held_out = task(recording(40), recording(20, 50.0)).split()
    assert [len(each.u) for each in fitted] == [30, 15]
    assert [each.u[0, 0] for each in held_out] == [27.0, 62.0]
    assert [len(each.y) for each in held_out] == [13, 8]


def test_a_recording_with_few_samples_is_held_out_from_its_start():
    _, held_out = task(recording(4), known=3).split()
    assert [len(each.u) for each in held_out] == [4]
    _, held_out = task(recording(4), known=10).split()
    assert [len(each.u) for each in held_out] == [4]


def test_the_error_leaves_the_initial_samples_out():
    assert task().measure_error(repeat(105.0), [recording(5)]) == pytest.approx((0.5 * (2.0**2 + 1.0)) ** 0.5)
    assert task().measure_error(repeat(np.nan), [recording(5)]) == np.inf


def test_rows_have_the_outputs_before_and_the_inputs_until_the_sample():
    rows, y = task().make_rows(recording(4), 2)
    np.testing.assert_array_equal(rows, [[101.0, 100.0, 2.0, 1.0, 0.0], [102.0, 101.0, 3.0, 2.0, 1.0]])
    np.testing.assert_array_equal(y, [[102.0], [103.0]])


def test_a_free_run_starts_after_the_given_outputs():
    def predict(u, y):
        np.testing.assert_array_equal(u[:, 0], [1.0, 2.0, 3.0, 4.0])
        np.testing.assert_array_equal(y[:, 0], [101.0, 102.0])
        return np.vstack([y, [[7.0], [8.0]]])

    whole = recording(5)
    simulated = task().run_freely(predict, 2)(whole.u, whole.y[:3])
    np.testing.assert_array_equal(simulated[:, 0], [100.0, 101.0, 102.0, 7.0, 8.0])


def test_the_candidate_with_the_least_error_is_fitted_to_all_data():
    seen = []

    def fit(recordings, candidate, _task):
        seen.append((candidate["level"], len(recordings[0].u)))
        if candidate["level"] == 0:
            raise ValueError("a peer fails")
        return repeat(float(candidate["level"] + 10 * (len(recordings[0].u) < 40)))

    levels = [{"level": level} for level in (0, 500, 110, 400)]
    model, chosen = choose(levels, fit, task(recording(40)))
    assert chosen == "level 110"
    assert seen == [(0, 30), (500, 30), (110, 30), (400, 30), (110, 40)]
    assert model(np.zeros((1, 1)), np.zeros((1, 1)))[0, 0] == 120.0


def test_a_model_of_all_data_replaces_that_of_the_candidate_if_it_is_better():
    model, _ = choose(
        [{"a": 1}], lambda recordings, *_: repeat(80.0 + len(recordings[0].u)), task(recording(40))
    )
    assert model(np.zeros((1, 1)), np.zeros((1, 1)))[0, 0] == 120.0


def test_candidates_without_time_are_left_out(monkeypatch):
    monkeypatch.setattr(child, "measure_cpu", count(0, 10).__next__)
    seen = []
    choose(
        [{"a": 1}, {"a": 2}],
        lambda _r, c, _t: seen.append(c["a"]) or repeat(1.0),
        task(recording(40), limit=60),
    )
    assert seen == [1, 1]


def test_a_script_without_a_model_says_why():
    with pytest.raises(SystemExit, match="the last one because: the free run diverges"):
        choose([{"a": 1}], lambda *_: repeat(np.nan), task(recording(40)))


def test_a_request_is_read_as_it_was_written(tmp_path):
    child.write_request(tmp_path, [recording(4), recording(5)], [recording(6)], 7.0)
    estimation, tests, limit = child._read_request(tmp_path)
    assert [len(each.u) for each in (*estimation, *tests)] == [4, 5, 6]
    np.testing.assert_array_equal(tests[0].y, recording(6).y)
    assert limit == 7.0
