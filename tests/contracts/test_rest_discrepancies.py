"""Discrepancy jobs over REST: submission, validation, result, report and extended simulation."""

import json
import re
import subprocess
import sys

import pytest

from islands_service.domain.job import JobOutcome, JobState
from support.service import (
    HIDDEN,
    hidden,
    problem_of,
    run_diagnosis,
)
from support.stores import claimed

TERM = {"regressor": "y(k-1)", "parameter": 0.5}

#: A valid model file for the data set of the tests.
MODEL = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "terms": [TERM, {**TERM, "regressor": "u(k-1)"}],
}


@pytest.fixture(scope="module")
def finished(serve):
    """A service with a finished diagnosis of a record with an injected effect, and the id of the job."""
    with serve() as running:
        yield running, run_diagnosis(running, hidden(running.settings.data_dir))


def submit_diagnosis(service, headers=None, /, **order):
    return service.client.post("/v1/discrepancies", json=order, headers=headers)


def make_model_simulation(*terms, **changes):
    model = {**MODEL, **({"terms": [{**TERM, "regressor": text} for text in terms]} if terms else {})}
    return {"simulation": {"kind": "model", "model": {**model, **changes}}}


def test_recordings_that_share_samples_are_refused(service, order):
    recordings = [{"dataset": order["dataset"], "rows": "50:"}]
    refused = submit_diagnosis(service, **order, recordings=recordings)
    assert "share samples" in problem_of(refused, 422, "invalid-settings")


@pytest.mark.parametrize(
    "changes",
    [
        {"simulation": {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.5}}, "tolerance": {"dp": 0.01}},
        {"input": "u_V+1"},
        pytest.param({"seed": 2**63 - 1, "channels": ["t_s"], "output": "y_um"}, marks=pytest.mark.ci),
        make_model_simulation(),
    ],
)
def test_a_valid_request_is_accepted_and_stored_unchanged(service, order, changes):
    if "channels" in changes:  # a time channel would define the sampling time
        order["dataset"] = service.upload(b"a,u_V,y_um\n" + b"1,2,3\n2,3,5\n4,1,9\n" * 20).json()["id"]
        changes = {**changes, "channels": ["a"], "dt": 0.1}
    answer = submit_diagnosis(service, **{**order, **changes})
    assert answer.status_code == 202, answer.text
    assert answer.json()["spec"] == {**order, **changes}


#: Invalid requests: changed fields, problem type, part of the message.
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
    "unknown output": ({"output": "y_m"}, "invalid-record", "Did you mean 'y_um'?"),
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
        "column y_um is given as the simulation and also as an input, a channel or the output",
    ),
    "no kind": ({"simulation": {"kind": "pendulum"}}, "invalid-request", "/simulation: Input tag 'pendulum'"),
    "code": (
        {"simulation": {"kind": "python", "file": "model.py", "function": "run"}},
        "invalid-request",
        "/simulation: Input tag 'python'",
    ),
    "mistyped kind": (
        {"simulation": {"kind": "second-oder"}},
        "invalid-request",
        "Did you mean 'second-order'?",
    ),
    "mistyped parameter": (
        {"simulation": {"kind": "linear", "order": 1, "dealy": 2}},
        "invalid-request",
        "/simulation/linear/dealy: Extra inputs are not permitted. Did you mean 'delay'?",
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
        "m.json is not a model file of schema islands.model/1",
    ),
    "no regressor": (make_model_simulation("z(k-1)"), "invalid-model", "terms.0.regressor"),
    "no text": (make_model_simulation(equation="\ud800"), "invalid-model", "is not a model file"),
    "far back": (
        make_model_simulation("y(k-9999)"),
        "invalid-settings",
        "reaches 9999 samples back, and 1000 is the most",
    ),
    "long": (
        make_model_simulation(*["y(k-1)"] * 101),
        "invalid-settings",
        "has 101 terms, and 100 is the most",
    ),
    "tolerance": (
        {"tolerance": {"dp": 1.5}},
        "invalid-request",
        "/tolerance/dp: Input should be less than 1",
    ),
    "noise level": (
        {"noise_level": 0.0},
        "invalid-request",
        "/noise_level: Input should be greater than 0",
    ),
    "long text": (make_model_simulation(equation="y" * 60_000), "invalid-settings", "and 50000 is the most"),
    "long name": (
        {"simulation": {"kind": "bouc-wen-piezo", "parameters": {"d" * 60_000: 1.0}}},
        "invalid-settings",
        "and 50000 is the most",
    ),
    "rows": ({"rows": "5"}, "invalid-request", "/rows: cannot read the rows"),
    "unknown field": (
        {"inputs": ["u_V"]},
        "invalid-request",
        "Extra inputs are not permitted. Did you mean 'input'",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_request_that_could_only_fail_is_rejected(service, order, case):
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
def test_a_model_with_nested_powers_is_rejected_quickly(service, order, power):
    """Each power multiplies the factors of the inner one: expanding four of them would take all memory."""
    tower = "y(k-1)*u(k-1)"
    for _ in range(4):
        tower = f"({tower}){power}"
    answer = submit_diagnosis(service, **{**order, **make_model_simulation(tower)})
    assert "too long, or of too high a degree" in problem_of(answer, 422, "invalid-settings")


@pytest.mark.ci
def test_a_record_with_an_inconclusive_preview_is_inspected_again(service, order):
    lines = b"u_V,y_um,s\n" + b"".join(b"%d,%d,%d\n" % (k % 7, k % 5, k % 3) for k in range(500))
    order["dataset"] = service.upload(lines).json()["id"]
    detail = problem_of(submit_diagnosis(service, **order), 422, "invalid-record")
    assert "has no time column" in detail
    assert submit_diagnosis(service, **order, dt=0.1).status_code == 202
    detail = problem_of(submit_diagnosis(service, **order, dt=0.1, rows="0:9000"), 422, "invalid-record")
    assert "rows 0:9000 are not a part of it" in detail
    problem_of(submit_diagnosis(service, **{**order, "dataset": "0-csv"}), 404, "no-such-dataset")


@pytest.mark.ci
def test_a_diagnosis_names_the_injected_effect(finished):
    service, job = finished
    result = service.client.get(f"/v1/jobs/{job}/result").json()
    assert (result["schema"], result["verdict"]) == ("islands.discrepancy/1", "named")
    assert [effect["name"] for effect in result["effects"]] == [HIDDEN]
    assert "models" not in result
    assert result["wall_s"] > 0
    summary = service.client.get(f"/v1/jobs/{job}").json()["summary"]
    assert (summary["verdict"], summary["effects"]) == ("named", [HIDDEN])
    assert summary["reduction_percent"] == result["gain"]["reduction_percent"] > 10
    assert "thermal drift of the output (`thermal-drift`): k = " in summary["words"]
    extended = service.client.get(f"/v1/jobs/{job}/extended")
    assert extended.headers["content-type"] == "application/json"
    assert [effect["name"] for effect in extended.json()["effects"]] == [HIDDEN]


@pytest.mark.ci
def test_the_report_is_self_contained_and_has_a_strict_policy(finished):
    service, job = finished
    answer = service.client.get(f"/v1/jobs/{job}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script" not in policy
    assert answer.headers["vary"] == "Authorization, Accept-Encoding"
    assert all(each in answer.text for each in ("record.csv", "bouc-wen-piezo", job))
    assert not re.findall(r'(?:src|href)="(?!data:)', answer.text)


def test_a_diagnosis_without_effects_has_no_extended_simulation(service, order):
    job = submit_diagnosis(service, **order).json()["id"]
    found = JobOutcome(JobState.SUCCEEDED, {"verdict": "nothing"}, summary={"verdict": "nothing"})
    service.store.leases.finish(claimed(service.store), found)
    detail = problem_of(service.client.get(f"/v1/jobs/{job}/extended"), 404, "not-found")
    assert "its verdict is nothing" in detail


WEIGHT = """
import sys
from islands_api.web.app import create_app
from islands_api.schemas import DiscrepancyRequest
from islands_service.intake.job_validation import _check_spec
from islands_service.settings import ServiceSettings
import json
_check_spec(DiscrepancyRequest.model_validate(json.loads(sys.argv[1])), ServiceSettings())
heavy = {"numba", "llvmlite", "scipy", "matplotlib", "h5py", "ray"}
print(sorted(heavy & {name.partition(".")[0] for name in sys.modules}))
unused = ("islands.kernels", "islands.diagnosis.calibration", "islands.effects")
print([name for name in sys.modules if name.startswith(unused)])
"""


@pytest.mark.ci
def test_validation_of_a_model_imports_no_numerical_packages():
    order = {"dataset": "0-csv", "input": "u_V", "output": "y_um", **make_model_simulation()}
    command = [sys.executable, "-c", WEIGHT, json.dumps(order)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n[]\n"
