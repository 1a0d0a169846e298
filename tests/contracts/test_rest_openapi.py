"""Responses of all routes match the OpenAPI document."""

import json
import re
import xml.etree.ElementTree as ET

import pytest
from jsonschema import Draft202012Validator

from islands_api.web.routes import figures
from support.service import (
    columns,
    csv,
    held,
    kept,
    problem_of,
    queued,
    run_identification,
    spec,
)


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        yield running


@pytest.fixture(scope="module")
def finished(service):
    return run_identification(service, islands=2)


@pytest.fixture(scope="module")
def document(service):
    return service.client.get("/openapi.json").json()


def match_path(document, method, path):
    """Return the path template of the OpenAPI document that matches a path."""
    patterns = {known: re.sub(r"\{\w+\}", "[^/]+", known) for known in document["paths"]}
    (known,) = [
        known
        for known, pattern in patterns.items()
        if re.fullmatch(pattern, path) and method in document["paths"][known]
    ]
    return known


def check_response(document, answer):
    """Check the status, media type, body and headers of a response against the OpenAPI document."""
    method, path = answer.request.method.lower(), answer.request.url.path
    responses = document["paths"][match_path(document, method, path)][method]["responses"]
    response = responses.get(str(answer.status_code)) or responses["default"]
    if answer.is_error:
        assert str(answer.status_code) not in responses
    for name in response.get("headers", {}):
        assert name.lower() in answer.headers
    content = response.get("content", {})
    if not content:
        assert answer.content == b""
        return answer
    media = answer.headers["content-type"].partition(";")[0]
    assert media in content
    if "json" in media:
        schema = {**content[media]["schema"], "components": document["components"]}
        errors = list(Draft202012Validator(schema).iter_errors(answer.json()))
        assert not errors, errors[0]
    return answer


def test_the_openapi_document_describes_every_operation(document):
    for schema in document["components"]["schemas"].values():
        Draft202012Validator.check_schema(schema)
    assert document["components"]["securitySchemes"]["key"]["type"] == "http"
    for path, entry in document["paths"].items():
        for method, operation in entry.items():
            where = f"{method} {path}"
            assert operation["tags"], where
            assert operation["description"].endswith((".", "`")), where
            assert "default" in operation["responses"], where
            assert "422" not in operation["responses"], where
            for parameter in operation.get("parameters", []):
                assert parameter.get("description"), (where, parameter["name"])
    assert set(re.findall(r'"#/components/schemas/(\w+)"', json.dumps(document))) <= set(
        document["components"]["schemas"]
    )


def test_no_answer_in_json_is_without_fields(document):
    for path, entry in document["paths"].items():
        for method, operation in entry.items():
            for status, response in operation["responses"].items():
                schema = response.get("content", {}).get("application/json", {}).get("schema")
                # An export has the form of a file, which is JSON in one of many formats.
                is_typed = schema is None or path.endswith("/export") or {"$ref", "anyOf"} & schema.keys()
                assert is_typed, (method, path, status)


def test_every_example_of_the_openapi_document_is_valid(document):
    count = 0
    for name, schema in document["components"]["schemas"].items():
        for example in schema.get("examples", []):
            validator = Draft202012Validator({**schema, "components": document["components"]})
            assert not list(validator.iter_errors(example)), name
            count += 1
    assert count >= 3


@pytest.mark.ci
@pytest.mark.parametrize(
    "path",
    [
        "/v1/jobs",
        "/v1/jobs?limit=1",
        "/v1/jobs?state=succeeded",
        "/v1/jobs/{job}",
        "/v1/jobs/{job}?wait=0.1",
        "/v1/jobs/{job}/events",
        "/v1/jobs/{job}/history",
        "/v1/jobs/{job}/models",
        "/v1/jobs/{job}/models/1",
        "/v1/jobs/{job}/result",
        "/v1/jobs/{job}/figures",
        "/v1/jobs/{job}/models/1/figures",
        "/v1/datasets",
        "/v1/datasets/{dataset}",
        "/v1/monitors",
        "/v1/monitors/{monitor}",
        "/v1/admin/keys",
        "/v1/admin/owners",
        "/v1/admin/owners/local",
        "/healthz",
        "/readyz",
        "/metrics",
        "/problems/invalid-record",
    ],
)
def test_responses_of_get_requests_match_the_documentation(service, document, finished, path):
    dataset = service.client.get("/v1/datasets").json()["items"][0]["id"]
    monitor = service.store.monitors.create("local", "press", held(dataset), 0, 99).id
    answer = service.client.get(path.format(job=finished, dataset=dataset, monitor=monitor))
    assert answer.status_code == 200
    check_response(document, answer)


@pytest.mark.ci
def test_responses_of_other_requests_match_the_documentation(service, document):
    content = csv(100)
    dataset = check_response(document, service.upload(content))
    assert dataset.status_code == 201
    assert check_response(document, service.upload(content)).status_code == 200
    order = spec(dataset.json()["id"])
    job = check_response(document, service.submit(**order))
    path = job.headers["location"]
    for method, where, status in (
        ("POST", f"{path}/cancel", 202),
        ("POST", f"{path}/cancel", 409),
        ("POST", f"{path}/resume", 202),
        ("POST", f"{path}/cancel", 202),
        ("DELETE", path, 204),
        ("DELETE", path, 404),
        ("DELETE", dataset.headers["location"], 204),
    ):
        assert check_response(document, service.client.request(method, where)).status_code == status
    check_response(document, service.submit(**order))
    check_response(document, service.upload(b""))
    known = queued(service.store).id
    assert (
        check_response(
            document, service.client.get(f"/v1/jobs/{known}", headers={"If-None-Match": "*"})
        ).status_code
        == 304
    )
    service.client.post(f"/v1/jobs/{known}/cancel")
    columns = {name: value for name, value in held("").items() if name != "dataset"}
    monitor = check_response(document, service.client.post("/v1/monitors", json=columns))
    path = monitor.headers["location"]
    for method, where, body, status in (
        ("POST", f"{path}/records", {"dataset": kept(service.store)}, 202),
        ("GET", f"{path}/state", None, 404),
        ("DELETE", path, None, 204),
        ("DELETE", path, None, 404),
    ):
        answer = service.client.request(method, where, json=body)
        assert check_response(document, answer).status_code == status
    key = check_response(document, service.client.post("/v1/admin/keys", json={"scopes": ["read"]}))
    path = f"/v1/admin/keys/{key.json()['id']}/revoke"
    assert check_response(document, service.client.post(path)).status_code == 200
    change = service.client.patch("/v1/admin/owners/local", json={"weight": 7, "max_stored": None})
    assert check_response(document, change).status_code == 200
    ended = service.client.get(f"/v1/jobs/{known}/events", headers={"Last-Event-ID": "9"})
    assert check_response(document, ended).status_code == 204


@pytest.mark.ci
def test_a_model_equals_its_entry_in_the_result(service, finished):
    result = service.client.get(f"/v1/jobs/{finished}/result").json()
    models = service.client.get(f"/v1/jobs/{finished}/models").json()["items"]
    assert result["models"] == models
    assert [model["rank"] for model in models] == list(range(1, len(models) + 1))
    for model in models:
        assert service.client.get(f"/v1/jobs/{finished}/models/{model['rank']}").json() == model
    job = service.client.get(f"/v1/jobs/{finished}").json()
    (chosen,) = (model for model in models if model["recommended"])
    assert job["summary"]["size"] == chosen["size"]
    for name in ("rank", "reasons"):
        assert job["summary"][name] == result["recommended"][name]
    assert job["summary"]["models"] == len(models)
    assert models[0]["metrics"]["validation"]["free_run"]["mape"] < 1.0
    missing = service.client.get(f"/v1/jobs/{finished}/models/{len(models) + 1}")
    assert "see its /models" in problem_of(missing, 404, "not-found")


@pytest.mark.parametrize(
    "path", ["figures/nothing.svg", "models/1/figures/nothing.svg", "models/1/figures/record.svg"]
)
def test_an_unknown_figure_is_not_drawn(service, finished, path):
    detail = problem_of(service.client.get(f"/v1/jobs/{finished}/{path}"), 404, "not-found")
    assert "use one of" in detail


@pytest.mark.nightly
def test_every_figure_is_drawn_once_and_stored(service, document, finished, monkeypatch):
    drawn, draw = [], figures.run_figure_worker

    def observe(state, caller, arguments, failure):
        drawn.append(arguments)
        return draw(state, caller, arguments, failure)

    monkeypatch.setattr(figures, "run_figure_worker", observe)
    for resource, count in (("", 4), ("/models/1", 3)):
        names = service.client.get(f"/v1/jobs/{finished}{resource}/figures").json()["items"]
        assert len(names) == count
        for name in names:
            answer = check_response(
                document, service.client.get(f"/v1/jobs/{finished}{resource}/figures/{name}.svg")
            )
            assert ET.fromstring(answer.text).tag.endswith("svg")
            assert answer.headers["cache-control"] == "private, max-age=86400, immutable"
            table = check_response(
                document, service.client.get(f"/v1/jobs/{finished}{resource}/figures/{name}.csv")
            )
            assert table.text.startswith("panel,line,x,y\n1: ")
    # A process draws all figures of the search, and another all those of the model.
    assert drawn == [[finished], [finished, "--rank", "1"]]
    simulation = check_response(
        document, service.client.get(f"/v1/jobs/{finished}/models/1/simulation")
    ).json()
    assert len(simulation["measured"]) == len(simulation["free_run"]) == len(simulation["time_s"]) == 100
    assert simulation["inputs"]["u_V"] == pytest.approx(columns(400)["u_V"][300:], abs=1e-6)
    band = simulation["band"]
    assert band["level"] == 0.9
    limits = zip(band["lower"], simulation["free_run"], band["upper"], strict=True)
    assert all(low <= run <= high for low, run, high in limits if run is not None)
    report = check_response(document, service.client.get(f"/v1/jobs/{finished}/report"))
    assert report.text.startswith("<!DOCTYPE html>")
    assert "inclusion" in report.text
    assert "script" not in report.headers["content-security-policy"]
