"""Shapes: every route answers as its documentation says, from the first look to the last figure."""

import json
import re
import xml.etree.ElementTree as ET

import pytest
from jsonschema import Draft202012Validator

from islands.figures.registry import FIGURES, SEARCH_FIGURES
from islands.io.export import EXPORTS
from islands_api.web.routes.figures import MODEL_FIGURES
from islands_api.web.routes.figures import SEARCH_FIGURES as NAMED
from support.service import (
    columns,
    csv,
    diagnosed,
    hidden,
    identified,
    kept,
    problem_of,
    queued,
    spec,
)


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        yield running


@pytest.fixture(scope="module")
def finished(service):
    return identified(service, islands=2)


@pytest.fixture(scope="module")
def document(service):
    return service.client.get("/openapi.json").json()


def matched(document, method, path):
    """The documented path that a path is of."""
    patterns = {known: re.sub(r"\{\w+\}", "[^/]+", known) for known in document["paths"]}
    (known,) = [
        known
        for known, pattern in patterns.items()
        if re.fullmatch(pattern, path) and method in document["paths"][known]
    ]
    return known


def conforms(document, answer):
    """Hold an answer against what is documented of its route: status, media type, body, headers."""
    method, path = answer.request.method.lower(), answer.request.url.path
    responses = document["paths"][matched(document, method, path)][method]["responses"]
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


def test_the_documentation_says_what_everything_is(document):
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


def test_every_example_is_valid(document):
    count = 0
    for name, schema in document["components"]["schemas"].items():
        for example in schema.get("examples", []):
            validator = Draft202012Validator({**schema, "components": document["components"]})
            assert not list(validator.iter_errors(example)), name
            count += 1
    assert count >= 3


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
        "/healthz",
        "/readyz",
        "/metrics",
        "/problems/invalid-record",
    ],
)
def test_what_can_be_looked_at_is_as_documented(service, document, finished, path):
    dataset = service.client.get("/v1/datasets").json()["items"][0]["id"]
    answer = service.client.get(path.format(job=finished, dataset=dataset))
    assert answer.status_code == 200
    conforms(document, answer)


def test_what_can_be_done_is_as_documented(service, document):
    content = csv(100)
    dataset = conforms(document, service.upload(content))
    assert dataset.status_code == 201
    assert conforms(document, service.upload(content)).status_code == 200
    order = spec(dataset.json()["id"])
    job = conforms(document, service.submit(**order))
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
        assert conforms(document, service.client.request(method, where)).status_code == status
    conforms(document, service.submit(**order))
    conforms(document, service.upload(b""))
    known = queued(service.store).id
    assert (
        conforms(
            document, service.client.get(f"/v1/jobs/{known}", headers={"If-None-Match": "*"})
        ).status_code
        == 304
    )
    service.client.post(f"/v1/jobs/{known}/cancel")
    ended = service.client.get(f"/v1/jobs/{known}/events", headers={"Last-Event-ID": "9"})
    assert conforms(document, ended).status_code == 204


@pytest.mark.ci
def test_a_diagnosis_is_as_documented(service, document, tmp_path):
    job = diagnosed(service, hidden(tmp_path))
    for of in ("", "/events", "/result", "/report", "/extended"):
        answer = conforms(document, service.client.get(f"/v1/jobs/{job}{of}"))
        assert answer.status_code == 200
    assert conforms(document, service.client.get(f"/v1/jobs/{job}/models")).status_code == 404
    order = service.client.get(f"/v1/jobs/{job}").json()["spec"]
    assert conforms(document, service.client.post("/v1/discrepancies", json=order)).status_code == 202
    refused = service.client.post("/v1/discrepancies", json={**order, "input": "u"})
    assert conforms(document, refused).status_code == 422


def test_a_model_is_the_one_of_the_result(service, finished):
    result = service.client.get(f"/v1/jobs/{finished}/result").json()
    models = service.client.get(f"/v1/jobs/{finished}/models").json()["items"]
    assert result["models"] == models
    assert [model["rank"] for model in models] == list(range(1, len(models) + 1))
    for model in models:
        assert service.client.get(f"/v1/jobs/{finished}/models/{model['rank']}").json() == model
    job = service.client.get(f"/v1/jobs/{finished}").json()
    assert job["summary"]["size"] == models[0]["size"]
    assert job["summary"]["models"] == len(models)
    assert models[0]["metrics"]["validation"]["free_run"]["mape"] < 1.0
    missing = service.client.get(f"/v1/jobs/{finished}/models/{len(models) + 1}")
    assert "see its /models" in problem_of(missing, 404, "not-found")


@pytest.mark.parametrize("form", EXPORTS)
def test_a_model_is_taken_along_in_every_form(service, document, finished, form):
    path = f"/v1/jobs/{finished}/models/1/export"
    answer = service.client.get(path, params={"format": form})
    assert answer.status_code == 200
    assert answer.text
    assert re.fullmatch(r'inline; filename="model-01\.[a-z]+"', answer.headers["content-disposition"])
    documented = document["paths"]["/v1/jobs/{job}/models/{rank}/export"]["get"]
    (parameter,) = [each for each in documented["parameters"] if each["name"] == "format"]
    assert form in parameter["schema"]["enum"]
    assert answer.headers["content-type"].partition(";")[0] in documented["responses"]["200"]["content"]


def test_an_unknown_form_is_refused(service, finished):
    answer = service.client.get(f"/v1/jobs/{finished}/models/1/export", params={"format": "cobol"})
    detail = problem_of(answer, 422, "invalid-settings")
    assert "cobol" in detail
    assert "python" in detail


def test_the_figures_that_are_named_are_those_of_the_galleries():
    """The doors do not import the galleries: that would make every start wait for matplotlib."""
    assert tuple(FIGURES) == MODEL_FIGURES
    assert tuple(SEARCH_FIGURES) == NAMED


@pytest.mark.parametrize(
    "path", ["figures/nothing.svg", "models/1/figures/nothing.svg", "models/1/figures/record.svg"]
)
def test_a_figure_that_there_is_not_is_not_drawn(service, finished, path):
    detail = problem_of(service.client.get(f"/v1/jobs/{finished}/{path}"), 404, "not-found")
    assert "use one of" in detail


@pytest.mark.nightly
def test_every_figure_is_drawn_once_and_kept(service, document, finished):
    for of in ("", "/models/1"):
        names = service.client.get(f"/v1/jobs/{finished}{of}/figures").json()["items"]
        assert len(names) == 4
        for name in names:
            answer = conforms(document, service.client.get(f"/v1/jobs/{finished}{of}/figures/{name}.svg"))
            assert ET.fromstring(answer.text).tag.endswith("svg")
            assert answer.headers["cache-control"] == "private, max-age=86400, immutable"
    drawn = [entry["ms"] for entry in service.logs if entry.get("path", "").endswith(".svg")]
    assert sum(ms > 300 for ms in drawn) == 2  # all figures of a thing are drawn together
    simulation = conforms(document, service.client.get(f"/v1/jobs/{finished}/models/1/simulation")).json()
    assert len(simulation["measured"]) == len(simulation["free_run"]) == len(simulation["time_s"]) == 100
    assert simulation["inputs"]["u_V"] == pytest.approx(columns(400)["u_V"][300:], abs=1e-6)
    report = conforms(document, service.client.get(f"/v1/jobs/{finished}/report"))
    assert report.text.startswith("<!DOCTYPE html>")
    assert "script" not in report.headers["content-security-policy"]


@pytest.mark.nightly
def test_a_figure_of_a_record_that_is_gone_says_what_is_missing(service):
    job = identified(service)
    dataset = service.client.get(f"/v1/jobs/{job}").json()["spec"]["dataset"]
    problem_of(service.client.get(f"/v1/jobs/{job}/figures/islands.svg"), 404, "not-found")
    assert service.client.delete(f"/v1/datasets/{dataset}").status_code == 204
    for path in ("figures/record.svg", "models/1/figures/loop.svg", "models/1/simulation", "report"):
        detail = problem_of(service.client.get(f"/v1/jobs/{job}/{path}"), 404, "no-such-dataset")
        assert dataset in detail


def test_a_data_sets_preview_says_what_is_in_it(service):
    preview = service.upload(csv(123), "größe.csv").json()["preview"]
    assert (preview["samples"], preview["time"], preview["dt"], preview["warnings"]) == (123, "t_s", 0.01, [])
    for column, (name, values) in zip(preview["columns"], columns(123).items(), strict=True):
        assert (column["name"], column["unit"], column["samples"]) == (name, name.split("_")[1], 123)
        for field, expected in (
            ("minimum", values.min()),
            ("mean", values.mean()),
            ("deviation", values.std()),
        ):
            assert column[field] == pytest.approx(expected, abs=1e-6)
    assert kept(service.store) != kept(service.store, content=b"other")
