"""Contract of the store with monitors: records in order, each exactly once, with the state of the monitor."""

import json
from dataclasses import replace

import pytest

from islands_service.domain.job import MONITORING, JobOutcome, JobState, LeaseLostError, Requester
from islands_service.domain.monitoring import MonitorNotFoundError, MonitorStatus
from support.monitor_updates import make_entry, make_update
from support.stores import (
    ALICE,
    BOB,
    EXPIRED,
    LONG,
    at_once,
    claimed,
    contents,
    kinds,
    open_stores,
    submitted,
    turn_clock,
)


def created(store, owner=ALICE, most=10):
    return store.monitors.create(owner, "press", {"input": "u"}, 5, most)


def added(store, monitor, number=0, **changes):
    """Submit a record of a monitor."""
    spec = {"monitor": monitor.id, "number": number}
    return submitted(store, monitor.owner, kind=MONITORING, spec=spec, monitor=monitor.id, **changes)


def analysed(store, lease, is_alarm=False):
    """Return the outcome of a record that is added to the current state of its monitor."""
    monitor = store.monitors.get(lease.job.owner, lease.job.spec["monitor"])
    records = [*records_of(store, monitor), lease.job.spec["number"]]
    update = make_update(monitor, records, is_alarm)
    return JobOutcome(JobState.SUCCEEDED, {"number": lease.job.spec["number"]}, monitor=update)


def records_of(store, monitor):
    _, states = store.monitors.load(monitor.owner, monitor.id)
    return [] if states is None else [json.loads(each) for each in states.records]


def test_records_are_claimed_one_by_one_in_the_order_of_their_submission(store):
    """A higher priority, which orders other jobs, and a clock that goes back change nothing."""
    monitor = created(store)
    jobs = [added(store, monitor, 0)]
    turn_clock(store, -100.0)
    jobs += [added(store, monitor, number, priority=number) for number in (1, 2, 3)]
    for job in jobs:
        lease = claimed(store)
        assert lease.job.id == job.id
        assert store.leases.claim("another", LONG) is None
        store.leases.finish(lease, analysed(store, lease))
    assert records_of(store, monitor) == [0, 1, 2, 3]
    found = store.monitors.get(ALICE, monitor.id)
    assert (found.records, found.version, found.status, found.pending) == (4, 4, "normal", 0)


def test_a_record_whose_coordinator_ended_is_claimed_before_later_ones(store):
    monitor = created(store)
    job = added(store, monitor)
    added(store, monitor)
    lost = claimed(store, EXPIRED)
    again = claimed(store)
    assert lost.job.id == again.job.id == job.id
    store.leases.postpone(again, "the disk is slow", LONG)
    assert store.leases.claim("another", LONG) is None


def test_the_state_of_a_monitor_and_the_end_of_the_job_appear_together(store):
    monitor = created(store)
    job = added(store, monitor)
    lost = claimed(store, EXPIRED)
    outcome = analysed(store, lost)
    lease = claimed(store)
    before = contents(store)
    with pytest.raises(LeaseLostError):
        store.leases.finish(lost, outcome)
    assert contents(store) == before
    store.leases.finish(lease, outcome)
    assert (records_of(store, monitor), kinds(store, job.id)[-1]) == ([0], "succeeded")
    with pytest.raises(LeaseLostError):
        store.leases.finish(lease, outcome)
    assert records_of(store, monitor) == [0]


def test_an_update_of_an_earlier_version_of_the_monitor_changes_nothing(store):
    monitor = created(store)
    added(store, monitor)
    lease = claimed(store)
    outcome = analysed(store, lease)
    stale = replace(outcome, monitor=replace(outcome.monitor, version=7))
    before = contents(store)
    with pytest.raises(LeaseLostError, match="was changed or deleted"):
        store.leases.finish(lease, stale)
    assert contents(store) == before
    store.leases.finish(lease, outcome)


def analyse(store, monitor, **changes):
    """Submit and analyse one more record."""
    added(store, monitor, store.monitors.get(ALICE, monitor.id).records)
    lease = claimed(store)
    outcome = analysed(store, lease)
    store.leases.finish(lease, replace(outcome, monitor=replace(outcome.monitor, **changes)))


def test_a_record_is_stored_once_and_later_ones_do_not_change_its_row(store):
    monitor = created(store)
    analyse(store, monitor)
    (first,) = contents(store)["monitor_records"]
    for _ in range(2):
        analyse(store, monitor)
    rows = contents(store)["monitor_records"]
    assert len(rows) == 3
    assert first in rows


def test_only_the_records_since_the_start_are_loaded(store):
    monitor = created(store)
    analyse(store, monitor)
    analyse(store, monitor)
    analyse(store, monitor, start=2)
    _, states = store.monitors.load(ALICE, monitor.id)
    assert (states.start, states.records) == (2, ("2",))
    assert json.loads(store.monitors.saved(ALICE, monitor.id))["state"]["records"] == [0, 1, 2]


def test_records_are_read_in_pages_and_found_by_name_and_content(store):
    monitor = created(store)
    for _ in range(3):
        analyse(store, monitor)
    rejected = make_entry(9, 0, is_rejected=True)
    analyse(store, monitor, records=3, entry=rejected)
    found, after = [], -1
    while page := store.monitors.records(ALICE, monitor.id, False, after, 2):
        found += page
        after = json.loads(page[-1])["index"]
    assert [json.loads(each)["index"] for each in found] == [0, 1, 2]
    assert store.monitors.records(ALICE, monitor.id, True) == [rejected.document]
    same = ("record 1", f"{1:064x}")
    assert store.monitors.find_record(monitor.id, *same, is_rejected=False) == found[1]
    for name, sha256, is_rejected in ((*same, True), ("record 1", "", False), ("other", same[1], False)):
        assert store.monitors.find_record(monitor.id, name, sha256, is_rejected=is_rejected) is None
    with pytest.raises(MonitorNotFoundError):
        store.monitors.records(BOB, monitor.id, False)
    store.monitors.delete(ALICE, monitor.id)
    assert contents(store)["monitor_records"] == []


def test_an_alarm_is_delivered_once_to_every_webhook_that_asks_for_it(store):
    webhook, _ = store.webhooks.create(ALICE, "https://hooks.example.org/a", ("monitor.alarm",), 9)
    other, _ = store.webhooks.create(ALICE, "https://hooks.example.org/b", ("job.failed",), 9)
    monitor = created(store)
    job = [added(store, monitor, number) for number in range(2)][-1]
    for is_alarm in (False, True):
        lease = claimed(store)
        store.leases.finish(lease, analysed(store, lease, is_alarm))
    (sent,) = store.webhooks.deliveries(ALICE, webhook.id)
    assert (sent.event, sent.job) == ("monitor.alarm", job.id)
    assert store.webhooks.deliveries(ALICE, other.id) == ()
    (due,) = store.deliveries.claim(LONG, 10)
    body = json.loads(due.body)
    assert body["type"] == "monitor.alarm"
    assert body["data"]["monitor"] == monitor.id
    assert body["data"]["links"]["monitor"] == f"/v1/monitors/{monitor.id}"
    statistics = store.monitors.statistics()
    assert (statistics.counts[MonitorStatus.ALARM], statistics.alarms) == (1, 1)
    assert store.monitors.get(ALICE, monitor.id).last_alarm["record"] == {"index": 1}


def test_deletion_of_a_monitor_cancels_its_waiting_records(store):
    monitor, other = created(store), created(store)
    running, waiting, foreign = added(store, monitor), added(store, monitor), added(store, other)
    lease = claimed(store)
    outcome = analysed(store, lease)
    store.monitors.delete(ALICE, monitor.id, Requester("192.0.2.1"))
    assert store.jobs.get(ALICE, running.id).cancel_requested
    assert store.jobs.get(ALICE, waiting.id).state == JobState.CANCELLED
    assert store.jobs.get(ALICE, foreign.id).state == JobState.QUEUED
    with pytest.raises(LeaseLostError, match="was changed or deleted"):
        store.leases.finish(lease, outcome)
    with pytest.raises(MonitorNotFoundError):
        added(store, monitor)
    assert store.monitors.page(ALICE)[0] == (store.monitors.get(ALICE, other.id),)
    (entry,) = store.audit.entries(limit=1)
    assert (entry.action, entry.subject) == ("delete-monitor", monitor.id)


def test_a_monitor_of_another_owner_is_not_found(store):
    monitor = created(store, BOB).id
    reads = (store.monitors.get, store.monitors.load, store.monitors.result, store.monitors.saved)
    for operation in (*reads, store.monitors.delete):
        with pytest.raises(MonitorNotFoundError, match=monitor):
            operation(ALICE, monitor)
    with pytest.raises(MonitorNotFoundError):
        submitted(store, ALICE, kind=MONITORING, monitor=monitor)
    assert store.jobs.page(ALICE).jobs == ()


@pytest.mark.ci
def test_concurrent_coordinators_analyse_every_record_once_and_in_order(database):
    count, processes = 24, 4

    def work(store, name):
        while store.monitors.get(ALICE, monitor.id).pending:
            if (lease := store.leases.claim(name, LONG)) is not None:
                store.leases.finish(lease, analysed(store, lease))

    with open_stores(database, processes) as stores:
        monitor = created(stores[0])
        for number in range(count):
            added(stores[0], monitor, number)
        actions = [lambda store=store, at=at: work(store, f"{at}") for at, store in enumerate(stores)]
        assert at_once(actions) == [None] * processes
        assert records_of(stores[0], monitor) == list(range(count))
