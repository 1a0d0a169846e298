"""Options of reading over REST: a data set has them, and jobs read it with them."""

import json

import pytest

from support.bad_records import lines
from support.service import problem_of


@pytest.mark.ci
def test_the_same_bytes_read_in_another_way_are_another_data_set(service):
    content = "\n".join(lines()).encode()
    ids = [
        service.upload(content, reading=json.dumps(reading)).json()["id"]
        for reading in ({}, {"resample": 1}, {"resample": 1.0}, {})
    ]
    assert ids[0] == ids[3] != ids[1] == ids[2]


@pytest.mark.parametrize(
    "reading",
    [
        *("", "[]", "{", '{"sheets": "a"}', '{"header": "no"}', '{"resample": -1}'),
        *('{"resample": true}', f'{{"resample": 1{400 * "0"}}}', '{"names": ["\\ud800"]}', 9_000 * "["),
    ],
)
def test_invalid_options_are_refused(service, reading):
    problem_of(service.upload(b"t,u,y", reading=reading or "null"), 422, "invalid-settings")


@pytest.mark.parametrize(
    "reading", ['{"missing": ["Failed", "-9999"]}', '{"header": false}', '{"gaps": "split"}']
)
def test_every_option_of_reading_works_over_rest(service, reading):
    rows = lines() if "header" not in reading else lines()[1:]
    rows[9] = rows[9].rpartition(",")[0] + (",Failed" if "missing" in reading else ",1.5")
    stored = service.upload("\n".join(rows).encode(), reading=reading)
    assert stored.status_code == 201, stored.text
    document = stored.json()["preview"]
    assert document["reading"] == json.loads(reading)
    if "missing" in reading:
        assert "column y_um: Failed is read as missing in line 10" in document["warnings"]


@pytest.mark.parametrize("name", ["header", "missing", "inputz", "anything"])
def test_an_unknown_query_parameter_or_form_field_of_an_upload_is_refused(service, name):
    content = "\n".join(lines()).encode()
    files = {"file": ("record.csv", content)}
    query = service.client.post(f"/v1/datasets?{name}=false", files=files)
    field = service.upload(content, **{name: "false"})
    for answer, kind in ((query, "query parameter"), (field, "form field")):
        detail = problem_of(answer, 422, "invalid-settings")
        assert f"/v1/datasets has no {kind} '{name}'" in detail
        assert ("reading={" in detail) == (name in {"header", "missing"})
    assert service.client.get("/v1/datasets").json()["items"] == []


@pytest.mark.parametrize("name", ["record.log", "record", "record.xls", "record.2026-11-22"])
def test_a_table_of_text_is_uploaded_under_any_name(service, name):
    stored = service.upload("\n".join(lines()).encode(), name)
    assert stored.status_code == 201, stored.text
    document = stored.json()
    assert document["name"] == name
    job = service.submit(dataset=document["id"], inputs=["u_V"], output="y_um")
    assert job.status_code == 202, job.text


@pytest.mark.ci
def test_an_mdf_file_under_another_name_is_refused(service):
    answer = service.upload(b"MDF     4.10    " + bytes(400), "record.dat")
    assert "MDF" in problem_of(answer, 422, "invalid-record")


@pytest.mark.parametrize("extra", [{"gaps": "split"}, {"reading": {"gaps": "split"}}])
def test_an_option_of_reading_in_a_job_is_refused_with_its_place(service, extra):
    """The message about a gap names the option; the job of the data set is not its place."""
    answer = service.submit(dataset="0" * 32 + "-csv", inputs=["u_V"], output="y_um", **extra)
    detail = problem_of(answer, 422, "invalid-request")
    assert detail.endswith("the form field reading of the upload states how a data set is read")
