"""Contract of the store for reports, results and figures: they are stored completely or not at all."""

import threading

import pytest

from islands_service.domain.job import JobNotFoundError, JobOutcome, JobState, LeaseLostError, ProgressReport
from islands_service.store import leases as leases_module
from support.stores import (
    ALICE,
    BLOB,
    CANCELLED,
    FAILED,
    FOUND,
    brought_on,
    claimed,
    contents,
    kinds,
    open_stores,
    point,
    submitted,
)


class Unwritable:
    """A value that JSON cannot represent."""


@pytest.fixture
def lease(store):
    submitted(store)
    return claimed(store)


def again(store, lease, ended=FAILED):
    """End a job, resume it, and claim it."""
    store.leases.finish(lease, ended)
    store.jobs.resume(ALICE, lease.job.id)
    return claimed(store)


def generations(store, lease, **limits):
    return [each[0] for each in store.results.history(lease.job.id, **limits)]


def test_parts_of_a_report_appear_together(store, lease):
    reported = store.leases.report(lease, brought_on(7))
    assert reported == store.jobs.get(ALICE, lease.job.id)
    assert reported.version == lease.job.version + 1
    assert (reported.state, reported.progress, reported.checkpoint) == (
        JobState.RUNNING,
        {"generation": 7},
        f"{7:064x}",
    )
    assert store.results.history(lease.job.id) == [[7, 70, {"3": 1 / 8}, [0.5, None]]]
    event = store.jobs.events(lease.job.id)[-1]
    assert (event.kind, event.number, event.data) == ("progress", reported.version, reported.progress)
    assert event.at == reported.updated


@pytest.mark.ci
def test_reader_never_sees_a_part_of_a_report(database):
    with open_stores(database, 2) as (writer, reader):
        job = submitted(writer)
        lease = claimed(writer)
        over = threading.Event()

        def report():
            try:
                for generation in range(150):
                    writer.leases.report(lease, brought_on(generation))
            finally:
                over.set()

        thread = threading.Thread(target=report)
        thread.start()
        seen = set()
        while not over.wait(0.001):
            history = reader.results.history(job.id)
            found = reader.jobs.get(ALICE, job.id)
            if found.progress is not None:
                generation = found.progress["generation"]
                assert found.checkpoint == brought_on(generation).checkpoint
                assert found.version == generation + 3
                assert len(history) <= generation + 1
                assert len(reader.results.history(job.id)) >= generation + 1
                assert reader.jobs.events(job.id)[-1].number >= found.version
                seen.add(generation)
        thread.join()
        assert seen
        assert kinds(reader, job.id)[-1] == "progress"


BROKEN = {
    "progress": ProgressReport({"generation": Unwritable()}, (point(2),), BLOB),
    "a point's values": ProgressReport({"generation": 2}, (point(2), (3, 30, {3: Unwritable()}, ())), BLOB),
    "the same point twice": ProgressReport({"generation": 2}, (point(2), point(2)), BLOB),
    "a point without a number": ProgressReport({"generation": 2}, (point(2), (None, 1, {}, ())), BLOB),
}


@pytest.mark.parametrize("report", BROKEN.values(), ids=BROKEN)
def test_failed_report_is_rolled_back(store, lease, report):
    store.leases.report(lease, brought_on(1))
    before = contents(store)
    with pytest.raises(Exception):  # noqa: B017, PT011 - any error of the caller
        store.leases.report(lease, report)
    assert contents(store) == before
    assert store.leases.report(lease, brought_on(2)).progress == {"generation": 2}


def test_report_without_a_checkpoint_keeps_the_previous_one(store, lease):
    store.leases.report(lease, brought_on(4))
    reported = store.leases.report(lease, ProgressReport({"generation": 5}, (point(5),), after=4))
    assert (reported.checkpoint, reported.progress) == (brought_on(4).checkpoint, {"generation": 5})
    assert generations(store, lease) == [4, 5]


def test_points_replace_those_after_the_given_generation(store, lease):
    """After a crash the same generations are reported again, from the checkpoint on."""
    store.leases.report(lease, ProgressReport({}, tuple(map(point, range(8)))))
    store.leases.report(lease, ProgressReport({}, ((5, 99, {2: 0.25}, (0.25,)), point(6)), after=4))
    assert generations(store, lease) == [0, 1, 2, 3, 4, 5, 6]
    assert store.results.history(lease.job.id, after=4, limit=1) == [[5, 99, {"2": 0.25}, [0.25]]]
    store.leases.report(lease, ProgressReport({}, (point(6),), after=2))
    assert generations(store, lease) == [0, 1, 2, 6]
    store.leases.report(lease, ProgressReport({}, (point(3),)))
    assert generations(store, lease) == [3]


def test_only_old_progress_events_are_deleted(store, lease, monkeypatch):
    monkeypatch.setattr(leases_module, "KEPT", 5)
    for generation in range(20):
        store.leases.report(lease, brought_on(generation))
    events = store.jobs.events(lease.job.id)
    assert [event.kind for event in events] == ["queued", "running", *["progress"] * 5]
    assert [event.number for event in events] == [1, 2, 18, 19, 20, 21, 22]
    assert store.jobs.versions([lease.job.id]) == {lease.job.id: 22}


def test_checkpoint_is_kept_unless_the_job_succeeds(store):
    kept = {}
    for outcome in (FOUND, FAILED, CANCELLED):
        submitted(store)
        lease = claimed(store)
        store.leases.report(lease, brought_on(3))
        store.leases.finish(lease, outcome)
        kept[outcome.state] = store.jobs.get(ALICE, lease.job.id).checkpoint
    checkpoint = brought_on(3).checkpoint
    assert kept == {"succeeded": None, "failed": checkpoint, "cancelled": checkpoint}


HALVES = {
    "document": JobOutcome(JobState.SUCCEEDED, {"a": Unwritable()}, FOUND.models),
    "a model": JobOutcome(JobState.SUCCEEDED, {}, (*FOUND.models, ({"a": Unwritable()}, ""))),
    "a model's file": JobOutcome(JobState.SUCCEEDED, {}, (*FOUND.models, ({}, None))),
    "summary": JobOutcome(JobState.SUCCEEDED, {}, FOUND.models, {"a": Unwritable()}),
    "an artefact": JobOutcome(JobState.SUCCEEDED, {}, FOUND.models, artefacts={"a": None}),
}


@pytest.mark.parametrize("outcome", HALVES.values(), ids=HALVES)
def test_failed_finish_leaves_the_job_running(store, lease, outcome):
    store.leases.report(lease, brought_on(1))
    before = contents(store)
    with pytest.raises(Exception):  # noqa: B017, PT011 - any error of the caller
        store.leases.finish(lease, outcome)
    assert contents(store) == before
    store.leases.finish(lease, FOUND)


def test_new_result_replaces_the_whole_old_one(store, lease):
    job = lease.job.id
    lease = again(store, lease, JobOutcome(JobState.CANCELLED, {"old": 1}, FOUND.models))
    store.results.keep(job, {"pareto.svg": BLOB})
    # The previous result is available until there is a new one.
    assert store.results.document(job) == {"old": 1}
    store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {"new": 1}, (({"fitness": 0.1}, "only"),)))
    assert store.results.document(job) == {"new": 1}
    assert [each.file for each in store.results.models(job)] == ["only"]
    assert store.results.artefact(job, "pareto.svg") is None


def test_finish_without_a_result_keeps_the_old_one(store, lease):
    job = lease.job.id
    lease = again(store, lease, JobOutcome(JobState.CANCELLED, {"old": 1}, FOUND.models))
    store.results.keep(job, {"pareto.svg": BLOB})
    store.leases.finish(lease, FAILED)
    assert store.results.document(job) == {"old": 1}
    assert len(store.results.models(job)) == 2
    assert store.results.artefact(job, "pareto.svg") == BLOB


def test_artefacts_of_a_deleted_job_are_refused(store, lease):
    store.leases.finish(lease, FOUND)
    store.jobs.delete(ALICE, lease.job.id)
    # The job may be deleted while its figures are rendered.
    with pytest.raises(JobNotFoundError, match=lease.job.id):
        store.results.keep(lease.job.id, {"a": BLOB})
    with pytest.raises(LeaseLostError):
        store.leases.report(lease, brought_on(1))
    assert {table for table, rows in contents(store).items() if rows} == {"owners"}
