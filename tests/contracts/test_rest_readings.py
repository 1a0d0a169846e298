"""Data sets that are read in another way, by the options that their notes advise."""

import pytest

from islands_api import Client
from islands_service.store.audit import Action
from support.service import csv, problem_of, spec

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def gaps():
    """A record in which 40 rows are missing after the row 99, and one input is empty in row 150."""
    lines = csv().decode().splitlines()
    cells = lines[151].split(",")
    lines[151] = f"{cells[0]},,{cells[2]}"
    return "\n".join([*lines[:101], *lines[141:]]).encode()


def test_an_option_of_a_note_makes_the_record_usable(service, gaps):
    dataset = service.upload(gaps).json()
    problems = [note for note in dataset["preview"]["notes"] if note["is_problem"]]
    assert [note["text"] for note in dataset["preview"]["notes"]] == dataset["preview"]["warnings"]
    assert {"option": "gaps", "value": "split"} in problems[0]["advice"]
    assert {row for note in problems for row in note["rows"]} == {100, 110}
    assert dataset["preview"]["inspection"]["remedy"] == {"gaps": "split"}
    refused = service.client.post("/v1/jobs", json=spec(dataset["id"]))
    assert problem_of(refused, 422, "invalid-record")
    path = f"/v1/datasets/{dataset['id']}/readings"
    answer = service.client.post(path, json={"reading": dataset["preview"]["inspection"]["remedy"]})
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert answer.headers["location"] == f"/v1/datasets/{made['id']}"
    assert (made["preview"]["reading"], made["sha256"]) == ({"gaps": "split"}, dataset["sha256"])
    assert not any(note["is_problem"] for note in made["preview"]["notes"])
    (entry,) = service.store.audit.entries("local", limit=1)
    assert (entry.action, entry.subject) == (Action.UPLOAD, made["id"])
    accepted = service.client.post("/v1/jobs", json=spec(made["id"]))
    assert accepted.status_code == 202, accepted.text
    service.client.post(f"/v1/jobs/{accepted.json()['id']}/cancel")


def test_without_options_the_first_data_set_is_returned(service, gaps):
    with Client(service.url) as client:
        first = service.upload(gaps).json()
        split = client.read_again(first["id"], {"gaps": "split"})
        assert client.read_again(split, {}).id == first["id"]


@pytest.mark.parametrize(
    ("reading", "expected"),
    [
        ({"gap": "split"}, "reading is a JSON object of options"),
        ({"gaps": "join"}, "one of split, interpolate"),
    ],
)
def test_unknown_options_are_refused_with_the_known_ones(service, gaps, reading, expected):
    dataset = service.upload(gaps).json()["id"]
    answer = service.client.post(f"/v1/datasets/{dataset}/readings", json={"reading": reading})
    assert expected in problem_of(answer, 422, "invalid-settings")


def test_a_data_set_that_does_not_exist_has_no_reading(service):
    answer = service.client.post("/v1/datasets/0-csv/readings", json={"reading": {}})
    assert problem_of(answer, 404, "no-such-dataset")
