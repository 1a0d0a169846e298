"""Monitors over REST: creation, records in order, states, owners, and the same bits as the library."""

import json

import pytest

from islands.report.documents import monitor_state
from islands_api.client import Client
from islands_service.domain.job import DISCREPANCY, EXTENDED, JobOutcome, JobState
from islands_service.store import monitors
from islands_service.store.blobs import Blobs
from support.service import held, kept, problem_of
from support.stores import claimed, submitted

PIEZO = {"simulation": {"kind": "bouc-wen-piezo"}, "input": "u_V", "output": "y_um"}

UNKNOWN = "0" * 32

#: Extended simulation as a diagnosis writes it, with a channel.
FOUND = {
    "kind": "extended",
    "schema": "islands.extended/1",
    "inputs": ["u_V", "T_K"],
    "output": "y_um",
    "core": {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.6}},
    "effects": [],
    "scales": {
        **dict.fromkeys(("dt", "input_peak", "output_peak", "fitted_s", "duration_s"), 1.0),
        "frame": {
            **dict.fromkeys(("peak", "rate", "force", "sense", "sharp"), 1.0),
            "unit": "um",
            "force_unit": "V",
            "dissipates": False,
        },
    },
}


def create(service, **changes):
    answer = service.client.post("/v1/monitors", json={**PIEZO, **changes})
    assert answer.status_code == 201, answer.text
    assert answer.headers["location"] == f"/v1/monitors/{answer.json()['id']}"
    return answer.json()


def add(service, monitor, dataset, headers=None, **changes):
    body = {"dataset": dataset, **changes}
    return service.client.post(f"/v1/monitors/{monitor['id']}/records", json=body, headers=headers)


def test_the_service_reads_the_states_of_the_library():
    assert monitors.STATE_SCHEMA == monitor_state.SCHEMA


def test_the_client_creates_reads_lists_and_deletes_monitors(service):
    with Client(service.url) as client:
        made = client.create_monitor(
            simulation="bouc-wen-piezo", input="u_V", output="y_um", interval=3600.0, name="press 4"
        )
        assert (made.name, made.status, made.records, made.result) == ("press 4", "waiting", 0, None)
        assert client.monitor(made) == made
        assert [each.id for each in client.monitors().items] == [made.id]
        job = client.add_record(made, kept(service.store), name="hour 1")
        assert (job.kind, job.name, job.spec["monitor"]) == ("monitoring", "hour 1", made.id)
        assert client.monitor(made.id).pending == 1
        client.delete_monitor(made)
        assert client.monitors().items == ()
        assert client.job(job).state == "cancelled"


def test_a_record_is_added_once_for_each_idempotency_key(service, order):
    monitor, dataset = create(service, priority=7), order["dataset"]
    first = add(service, monitor, dataset, {"Idempotency-Key": "k"})
    again = add(service, monitor, dataset, {"Idempotency-Key": "k"})
    assert (first.status_code, again.headers["idempotent-replayed"]) == (202, "true")
    assert first.json()["id"] == again.json()["id"]
    assert first.json()["priority"] == 7
    assert service.client.get(f"/v1/monitors/{monitor['id']}").json()["pending"] == 1
    detail = problem_of(service.client.delete(f"/v1/datasets/{dataset}"), 409, "dataset-in-use")
    assert first.json()["id"] in detail


@pytest.mark.parametrize("extended", [None, FOUND], ids=["nothing", "named"])
def test_the_simulation_and_columns_of_a_diagnosis_are_monitored(service, order, extended):
    spec = held(order["dataset"], channels=["T_K", "p"], dt=0.5)
    job = submitted(service.store, "local", kind=DISCREPANCY, spec=spec)
    refused = service.client.post("/v1/monitors", json={"diagnosis": job.id})
    problem_of(refused, 409, "not-finished")
    files = {}
    if extended is not None:
        files[EXTENDED] = Blobs(service.settings.blobs).write(json.dumps(extended).encode())
    outcome = JobOutcome(JobState.SUCCEEDED, {"verdict": "any"}, artefacts=files)
    service.store.leases.finish(claimed(service.store), outcome)
    answer = service.client.post("/v1/monitors", json={"diagnosis": job.id, "training": 30})
    assert answer.status_code == 201, answer.text
    found = answer.json()["spec"]
    assert (found["input"], found["output"], found["dt"], found["training"]) == ("u_V", "y_um", 0.5, 30)
    assert found["diagnosis"] == job.id
    assert found["channels"] == (["T_K", "p"] if extended is None else ["T_K"])
    assert found["simulation"]["kind"] == ("bouc-wen-piezo" if extended is None else "extended")


REFUSED = {
    "no simulation": ({"simulation": None}, "invalid-request", "give the diagnosis, or simulation"),
    "two": ({"diagnosis": UNKNOWN}, "invalid-request", "the diagnosis has input, output, simulation"),
    "rate": ({"false_alarms": "often"}, "invalid-request", "is no rate of false alarms"),
    "training": ({"training": 5}, "invalid-request", "greater than or equal to 12"),
    "parameter": ({"tolerance": {"mass": 0.1}}, "invalid-settings", "has no parameter 'mass'"),
    "channel": ({"channels": ["u_V"]}, "invalid-record", "is the input itself"),
    "code": ({"simulation": {"kind": "python"}}, "invalid-request", "/simulation"),
}


@pytest.mark.ci
@pytest.mark.parametrize("case", REFUSED)
def test_a_monitor_that_cannot_work_is_refused(service, case):
    changes, kind, words = REFUSED[case]
    answer = service.client.post("/v1/monitors", json={**PIEZO, **changes})
    problem_of(answer, 422, kind)
    assert words in answer.text
    assert service.client.get("/v1/monitors").json() == {"items": [], "next": None}


def test_a_record_that_cannot_be_read_is_refused(service, order):
    monitor = create(service)
    problem_of(add(service, monitor, "0-csv"), 404, "no-such-dataset")
    problem_of(add(service, monitor, order["dataset"], time="noon"), 422, "invalid-request")
    problem_of(add(service, {"id": UNKNOWN}, order["dataset"]), 404, "no-such-monitor")
    other = create(service, channels=["T_K"])
    assert "T_K" in problem_of(add(service, other, order["dataset"]), 422, "invalid-record")
    assert service.client.get("/v1/jobs").json()["items"] == []
