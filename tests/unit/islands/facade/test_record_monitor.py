"""A monitor of an oscillator: causes, instants, false alarms, and continuation from its saved state."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from islands.diagnosis.monitoring.record_follower import AlarmKind
from islands.errors import RecordError, SettingsError
from islands.facade.record_monitor import create_monitor, monitor_record
from islands.report.documents.monitor_json import (
    describe_alarm,
    describe_alarm_text,
    describe_last_record,
    describe_status,
    monitor_document,
)
from islands.report.documents.monitor_state import (
    head_to_json,
    monitor_from_head,
    monitor_from_json,
    monitor_to_json,
    record_to_json,
)
from lab.diagnosis.monitor import run
from support.monitored_oscillator import (
    ONSET,
    SIMULATION,
    TRAINING,
    follow,
    make_records,
    undisturbed_monitor,
)


def disturb(**change):
    """Return the monitor after six records with a change."""
    return follow(make_records(ONSET + 6, **change)[ONSET:], undisturbed_monitor())


@pytest.mark.ci
@pytest.mark.parametrize(
    ("change", "kind", "cause"),
    [
        ({"k": 97.0}, AlarmKind.PARAMETER, "k"),
        pytest.param({"c": 2.2}, AlarmKind.PARAMETER, "c", marks=pytest.mark.nightly),
        ({"play": 0.5}, AlarmKind.EFFECT, "backlash"),
    ],
)
def test_a_change_is_named_with_its_cause_and_instant(change, kind, cause):
    state = disturb(**change).state
    (alarm,) = state.alarms
    assert (alarm.kind, alarm.cause) == (kind, cause)
    assert alarm.earliest <= ONSET <= alarm.latest
    assert abs(alarm.since - ONSET) <= 1
    assert f"since record {alarm.since}" in describe_alarm_text(state, alarm)


@pytest.mark.ci
def test_an_unchanged_machine_raises_no_alarm_and_trains_once():
    state = undisturbed_monitor().state
    assert not state.alarms
    tested = [each.statistic is not None for each in state.records]
    assert tested == [index > TRAINING for index in range(ONSET)]


@pytest.mark.ci
def test_a_continued_monitor_has_the_bits_of_an_uninterrupted_one():
    saved = undisturbed_monitor()
    for record in make_records(ONSET + 6, k=97.0)[ONSET:]:
        saved = follow((record,), monitor_from_json(monitor_to_json(saved)))
    assert saved.state == disturb(k=97.0).state


@pytest.mark.nightly
def test_the_head_and_the_records_since_the_start_continue_with_the_same_bits():
    """The second change is found after the training that begins with the first one."""
    changed = make_records(ONSET + 6, k=97.0)
    records = (*changed, *changed[ONSET:] * 2, *make_records(ONSET + 4, c=2.2)[ONSET:])
    whole, part = undisturbed_monitor(), undisturbed_monitor()
    for record in records[ONSET:]:
        whole = follow((record,), whole)
        since = part.state.get_records_since_start()
        texts = [record_to_json(each) for each in since]
        part = monitor_from_head(head_to_json(part), part.state.start, texts)
        part = follow((record,), part)
        assert head_to_json(part) == head_to_json(whole)
        assert part.state.count == whole.state.count
        assert part.state.records == whole.state.records[part.state.first :]
        assert describe_last_record(part.state) == describe_last_record(whole.state)
        assert describe_status(part.state) == describe_status(whole.state)
    assert len(whole.state.alarms) == 2
    assert part.state.first >= ONSET - 1
    assert describe_alarm(part.state, part.state.alarms[-1]) == describe_alarm(
        whole.state, whole.state.alarms[-1]
    )


def test_a_record_that_cannot_be_analysed_leaves_the_monitor_valid():
    records = make_records(2)
    saved = follow(records[:1])
    with pytest.raises(RecordError, match="at least 200"):
        monitor_record(saved, records[1][:100], "short")
    with pytest.raises(RecordError, match="sampl"):
        monitor_record(saved, replace(records[1], dt=0.02), "slow")
    assert len(follow(records[1:], saved).state.records) == 2


def test_an_input_that_cannot_distinguish_an_effect_is_followed():
    """A single sine does not distinguish a rate limit from other effects; the monitor has its score."""
    records = make_records(2)
    assert "rate-limit" in follow(records).state.reference.names
    time = records[0].dt * np.arange(records[0].samples)
    u = 20.0 * np.sin(2 * np.pi * 2.0 * time)[:, None]
    _, x, _ = scipy.signal.lsim(
        ([[0.0, 1.0], [-100.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]), u, time
    )
    noise = 1e-3 * np.random.default_rng(8).standard_normal(time.size)
    state = follow((*records, replace(records[0], u=u, y=x + noise))).state
    assert len(state.records) == 3
    resting = replace(records[0], u=np.ones_like(u))
    with pytest.raises(RecordError, match="whose input varies"):
        follow((*records, resting))


def test_the_document_has_the_states_with_their_intervals():
    document = monitor_document(follow(make_records(1)))
    assert document["status"] == "training"
    values = document["records"][0]["values"]["k"]
    assert values["ci95"][0] < values["value"] < values["ci95"][1]
    assert document["records"][0]["scores"].keys() == {*document["effects"]}


@pytest.mark.parametrize(
    "given", [{"false_alarms": "0 per month"}, {"training": 3}, {"false_alarms": "2 per record"}]
)
def test_impossible_settings_are_refused(given):
    with pytest.raises(SettingsError):
        create_monitor(make_records(1)[0], SIMULATION, **given)


@pytest.mark.nightly
@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_a_month_of_an_unchanged_machine_has_at_most_one_false_alarm_on_average(colour):
    alarms = [run(seed, colour, 24 + 720, lambda _: {}, False) for seed in range(100, 104)]
    assert sum(map(len, alarms)) <= 8  # 4 are expected at most; exceeded with a probability of 2 %
