"""Discrepancy jobs over REST: jobs as all others are, with a result and a report of their own."""

import json
import re
import subprocess
import sys

import pytest

from islands_service.domain.job import DISCREPANCY, JobOutcome, JobState, ProgressReport
from support.service import HIDDEN, diagnosed, held, hidden, identified, kept, parsed, problem_of, served
from support.stores import LONG, claimed

TERM = {"regressor": "y(k-1)", "parameter": 0.5}

#: What `served` takes for a model.
MODEL = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "terms": [TERM, {**TERM, "regressor": "u(k-1)"}],
}


@pytest.fixture(scope="module")
def finished(serve):
    """A service with a job that has found what was hidden, and that job."""
    with serve() as running:
        yield running, diagnosed(running, hidden(running.settings.data_dir))


def submitted(service, headers=None, /, **order):
    return service.client.post("/v1/discrepancies", json=order, headers=headers)


def of_model(*terms, **changes):
    model = {**MODEL, **({"terms": [{**TERM, "regressor": text} for text in terms]} if terms else {})}
    return {"simulation": {"kind": "model", "model": {**model, **changes}}}


def test_it_is_a_job_among_the_others(service, order):
    answer = submitted(service, **order, name="piezo", priority=5)
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
    assert answer.headers["retry-after"] == "1"
    assert (job["kind"], job["state"], job["name"], job["priority"]) == (DISCREPANCY, "queued", "piezo", 5)
    assert job["spec"] == order
    assert service.client.get(answer.headers["location"]).json() == job
    other = service.submit(dataset=order["dataset"], inputs=["u_V"], output="y_um").json()
    listed = service.client.get("/v1/jobs").json()["items"]
    assert [(each["id"], each["kind"]) for each in listed] == [
        (other["id"], "identification"),
        (job["id"], DISCREPANCY),
    ]
    assert service.client.post(f"/v1/jobs/{job['id']}/cancel").json()["state"] == "cancelled"
    assert service.client.post(f"/v1/jobs/{job['id']}/resume").json()["state"] == "queued"
    assert "needs data set" in problem_of(
        service.client.delete(f"/v1/datasets/{order['dataset']}"), 409, "dataset-in-use"
    )


def test_one_key_is_one_job_of_one_kind(service, order):
    key = {"Idempotency-Key": "k1"}
    first = submitted(service, key, **order)
    again = submitted(service, key, **order)
    assert (again.status_code, again.headers["idempotent-replayed"]) == (202, "true")
    assert again.json() == first.json()
    problem_of(submitted(service, key, **{**order, "seed": 1}), 422, "idempotency-conflict")
    other = service.submit(key, dataset=order["dataset"], inputs=["u_V"], output="y_um")
    problem_of(other, 422, "idempotency-conflict")


def test_it_takes_a_place_in_the_quota(tmp_path):
    with served(tmp_path, max_active=1) as service:
        order = held(kept(service.store))
        assert submitted(service, **order).status_code == 202
        problem_of(submitted(service, **order), 429, "quota-exceeded")


@pytest.mark.parametrize(
    "changes",
    [
        {"simulation": {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.5}}, "tolerance": {"dp": 0.01}},
        {"input": "u_V+1"},
        {"seed": 2**63 - 1, "channels": ["t_s"], "output": "y_um"},
        of_model(),
    ],
)
def test_what_can_be_asked_is_accepted_as_it_was_said(service, order, changes):
    if "channels" in changes:  # time is a column like others; what it does to the sampling is looked at
        order["dataset"] = service.upload(b"a,u_V,y_um\n" + b"1,2,3\n2,3,5\n4,1,9\n" * 20).json()["id"]
        changes = {**changes, "channels": ["a"], "dt": 0.1}
    answer = submitted(service, **{**order, **changes})
    assert answer.status_code == 202, answer.text
    assert answer.json()["spec"] == {**order, **changes}


#: What no service carries out: what is changed, the type, what the message says.
REFUSED = {
    "unknown tolerance": (
        {"tolerance": {"mass": 0.1}},
        "invalid-settings",
        "bouc-wen-piezo has no parameter 'mass': it has A, beta, gamma, dp",
    ),
    "unknown parameter": (
        {"simulation": {"kind": "second-order", "parameters": {"m": 1.0, "d": 2.0}}, "tolerance": {}},
        "invalid-settings",
        "second-order has no parameter 'd': it has m, c, k",
    ),
    "several inputs": (
        {"input": ["u_V", "t_s"]},
        "invalid-request",
        "/input: a simulation is driven by one input: give the others as channels",
    ),
    "unknown input": ({"input": "u"}, "invalid-record", "record.csv has no column u; it has t_s, u_V, y_um"),
    "unknown output": ({"output": "y_m"}, "invalid-record", "Did you mean y_um?"),
    "unknown channel": ({"channels": ["T_K"]}, "invalid-record", "has no column T_K"),
    "channel is input": ({"channels": ["u_V"]}, "invalid-record", "channel u_V is the input itself"),
    "channel is early input": ({"channels": ["u_V+1"]}, "invalid-record", "u_V is given as an input twice"),
    "output is input": ({"output": "u_V"}, "invalid-record", "given as input and as output"),
    "no such column": (
        {"simulation": {"kind": "column", "column": "y_sim"}},
        "invalid-record",
        "has no column y_sim",
    ),
    "column is output": (
        {"simulation": {"kind": "column", "column": "y_um"}},
        "invalid-record",
        "column y_um is given as the simulation and as what it is held against",
    ),
    "no kind": ({"simulation": {"kind": "pendulum"}}, "invalid-request", "/simulation: Input tag 'pendulum'"),
    "code": (
        {"simulation": {"kind": "python", "file": "model.py", "function": "run"}},
        "invalid-request",
        "/simulation: Input tag 'python'",
    ),
    "no simulation": ({"simulation": None}, "invalid-request", "/simulation: "),
    "no number": (
        {"simulation": {"kind": "bouc-wen-piezo", "parameters": {"dp": "x"}}},
        "invalid-request",
        "/simulation/bouc-wen-piezo/parameters/dp: ",
    ),
    "no model": (
        {"simulation": {"kind": "model", "model": {"a": 1}, "name": "m.json"}},
        "invalid-model",
        "m.json is no model file of schema islands.model/1",
    ),
    "no regressor": (of_model("z(k-1)"), "invalid-model", "terms.0.regressor"),
    "no text": (of_model(equation="\ud800"), "invalid-model", "is no model file"),
    "far back": (
        of_model("y(k-9999)"),
        "invalid-settings",
        "reaches 9999 samples back, and 1000 is the most",
    ),
    "long": (of_model(*["y(k-1)"] * 101), "invalid-settings", "has 101 terms, and 100 is the most"),
    "tolerance": (
        {"tolerance": {"dp": 1.5}},
        "invalid-request",
        "/tolerance/dp: Input should be less than 1",
    ),
    "long text": (of_model(equation="y" * 60_000), "invalid-settings", "and 50000 is the most"),
    "long name": (
        {"simulation": {"kind": "bouc-wen-piezo", "parameters": {"d" * 60_000: 1.0}}},
        "invalid-settings",
        "and 50000 is the most",
    ),
    "rows": ({"rows": "5"}, "invalid-request", "/rows: cannot read the rows"),
    "unknown field": ({"inputs": ["u_V"]}, "invalid-request", "/inputs: Extra inputs are not permitted"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_could_only_fail_is_refused_at_the_door(service, order, case):
    changes, kind, words = REFUSED[case]
    answer = service.client.post(
        "/v1/discrepancies",
        content=json.dumps({**order, **changes}).encode(),
        headers={"Content-Type": "application/json"},
    )
    assert words in problem_of(answer, 422, kind)
    assert service.client.get("/v1/jobs").json()["items"] == []


@pytest.mark.timeout(20)
@pytest.mark.parametrize("power", ["**99", "^99", "** 9_9", "**(99)", "**0x63"])
def test_a_model_of_towering_powers_is_not_read(service, order, power):
    """Each power multiplies the factors of the one within it: four of them would take all memory."""
    tower = "y(k-1)*u(k-1)"
    for _ in range(4):
        tower = f"({tower}){power}"
    answer = submitted(service, **{**order, **of_model(tower)})
    assert "too long, or of too high a degree" in problem_of(answer, 422, "invalid-settings")


@pytest.mark.ci
def test_a_record_that_leaves_a_doubt_is_read_once_more(service, order):
    lines = b"u_V,y_um,s\n" + b"".join(b"%d,%d,%d\n" % (k % 7, k % 5, k % 3) for k in range(500))
    order["dataset"] = service.upload(lines).json()["id"]
    detail = problem_of(submitted(service, **order), 422, "invalid-record")
    assert "has no time column" in detail
    assert submitted(service, **order, dt=0.1).status_code == 202
    detail = problem_of(submitted(service, **order, dt=0.1, rows="0:9000"), 422, "invalid-record")
    assert "rows 0:9000 are not a part of it" in detail
    problem_of(submitted(service, **{**order, "dataset": "0-csv"}), 404, "no-such-dataset")


def test_what_was_hidden_is_found(finished):
    service, job = finished
    result = service.client.get(f"/v1/jobs/{job}/result").json()
    assert (result["schema"], result["verdict"]) == ("islands.discrepancy/1", "named")
    assert [effect["name"] for effect in result["effects"]] == [HIDDEN]
    assert "models" not in result
    assert result["wall_s"] > 0
    summary = service.client.get(f"/v1/jobs/{job}").json()["summary"]
    assert (summary["verdict"], summary["effects"]) == ("named", [HIDDEN])
    assert summary["reduction_percent"] == result["gain"]["reduction_percent"] > 10
    assert "thermal-drift: k = " in summary["words"]
    extended = service.client.get(f"/v1/jobs/{job}/extended")
    assert extended.headers["content-type"] == "application/json"
    assert [effect["name"] for effect in extended.json()["effects"]] == [HIDDEN]


def test_the_report_is_one_page_that_needs_and_may_do_nothing_else(finished):
    service, job = finished
    answer = service.client.get(f"/v1/jobs/{job}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script" not in policy
    assert answer.headers["vary"] == "Authorization, Accept-Encoding"
    assert "record.csv against bouc-wen-piezo" in answer.text
    assert not re.findall(r'(?:src|href)="(?!data:)', answer.text)


def test_its_events_say_where_it_is(finished):
    service, job = finished
    events = parsed(service.client.get(f"/v1/jobs/{job}/events").text)
    assert [number for number, _, _ in events] == list(range(1, len(events) + 1))
    kinds = [kind for _, kind, _ in events]
    assert (kinds[:2], kinds[-1], set(kinds[2:-1])) == (["queued", "running"], "succeeded", {"progress"})
    phases = [data["phase"] for _, kind, data in events if kind == "progress"]
    assert (phases[0], phases[-1]) == ("reading the record", "writing the report")
    assert len(phases) > 4
    assert events[-1][2]["verdict"] == "named"


@pytest.mark.parametrize(
    "of",
    [
        *("/models", "/models/1", "/models/1/export", "/models/1/figures", "/models/1/figures/loop.svg"),
        *("/models/1/simulation", "/figures", "/figures/record.svg", "/history"),
    ],
)
def test_what_a_search_alone_has_is_not_there(finished, of):
    service, job = finished
    detail = problem_of(service.client.get(f"/v1/jobs/{job}{of}"), 404, "not-found")
    assert f"job {job} is of the kind discrepancy, and only those of the kind identification" in detail
    assert "/report" in detail


def test_a_search_has_no_simulation_to_extend(service):
    job = identified(service)
    detail = problem_of(service.client.get(f"/v1/jobs/{job}/extended"), 404, "not-found")
    assert "is of the kind identification, and only those of the kind discrepancy" in detail


def test_where_nothing_was_named_there_is_nothing_to_extend(service, order):
    job = submitted(service, **order).json()["id"]
    found = JobOutcome(JobState.SUCCEEDED, {"verdict": "nothing"}, summary={"verdict": "nothing"})
    service.store.leases.finish(claimed(service.store), found)
    detail = problem_of(service.client.get(f"/v1/jobs/{job}/extended"), 404, "not-found")
    assert "found nothing" in detail


def test_before_it_has_ended_it_says_so(service, order):
    job = submitted(service, **order).json()["id"]
    lease = service.store.leases.claim("test", LONG)
    service.store.leases.report(lease, ProgressReport({"phase": "what is left over"}))
    for of in ("/result", "/report", "/extended"):
        detail = problem_of(service.client.get(f"/v1/jobs/{job}{of}"), 409, "not-finished")
        assert "wait until it has succeeded" in detail
    assert "islands_leases 1.0" in service.client.get("/metrics").text


WEIGHT = """
import sys
from islands_api.web.app import create_app
from islands_api.schemas import DiscrepancyRequest
from islands_service.intake.job_validation import _parts
from islands_service.settings import ServiceSettings
import json
_parts(DiscrepancyRequest.model_validate(json.loads(sys.argv[1])), ServiceSettings())
heavy = {"numba", "llvmlite", "scipy", "matplotlib", "h5py", "ray"}
print(sorted(heavy & {name.partition(".")[0] for name in sys.modules}))
print([name for name in sys.modules if name.startswith(("islands.kernels", "islands.discrepancy"))])
"""


@pytest.mark.ci
def test_a_door_needs_no_kernels_to_know_a_model():
    order = {"dataset": "0-csv", "input": "u_V", "output": "y_um", **of_model()}
    command = [sys.executable, "-c", WEIGHT, json.dumps(order)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n[]\n"
