"""Options of reading over REST: a data set has them, and jobs read it with them."""

import json

import pytest

from support.bad_records import lines
from support.service import problem_of

HEADERLESS = "\n".join(lines()[1:]).encode()
NAMES = {"names": ["t_s", "u_V", "y_um"]}


@pytest.mark.ci
def test_a_job_reads_a_record_without_a_header_with_given_names(service):
    refused = service.upload(HEADERLESS)
    assert "contains the number" in problem_of(refused, 422, "invalid-record")
    stored = service.upload(HEADERLESS, reading=json.dumps(NAMES))
    assert stored.status_code == 201
    document = stored.json()
    assert [column["name"] for column in document["preview"]["columns"]] == NAMES["names"]
    assert document["preview"]["reading"] == NAMES
    job = service.submit(dataset=document["id"], inputs=["u_V"], output="y_um", rows="0:50")
    assert job.status_code == 202, job.text


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
        *("", "[]", "{", '{"sheets": "a"}', '{"header": "no"}', '{"resample": -1}', '{"names": "a,b"}'),
        *('{"resample": true}', f'{{"resample": 1{400 * "0"}}}', '{"names": ["\\ud800"]}', 9_000 * "["),
    ],
)
def test_invalid_options_are_refused(service, reading):
    problem_of(service.upload(b"t,u,y", reading=reading or "null"), 422, "invalid-settings")


def test_an_unknown_option_has_similar_names(service):
    answer = service.upload(b"t,u,y", reading='{"sheets": "a"}')
    assert problem_of(answer, 422, "invalid-settings").endswith(
        "sheets: Unexpected keyword argument. Did you mean 'sheet'?"
    )
