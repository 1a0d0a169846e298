"""Validation of identification jobs over REST against the columns, rows and times of a real record."""

import pytest

from support.service import csv, emptied, npz, problem_of, spec

#: Unusual column names that a text table can have.
UNUSUAL_NAMES = ['u "in" V', "y\nout", "v;|\tw", "größe 😀", "<b>&amp;", "u+1"]


@pytest.fixture(scope="module")
def service(serve):
    with serve(max_job_memory=8_000_000_000) as running:
        yield emptied(running)


@pytest.fixture(scope="module")
def dataset(service):
    return service.upload(csv()).json()["id"]


@pytest.mark.ci
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"inputs": ["u_V+1"]},
        {"seed": 2**63 - 1},
        {"rows": "0:100", "validation": 0.3},
        {"rows": "-100:"},
        {"dt": 0.01},
        {"settings": {"islands": 2, "topology": "0>1,1>0", "migrate_every": "5,100:20"}},
        {"settings": {"islands": None}},
        {"name": "Größe 😀 <b>'\"&", "priority": -100},
    ],
)
def test_a_valid_job_is_accepted_and_stored_unchanged(service, dataset, changes):
    answer = service.submit(**spec(dataset, **changes))
    assert answer.status_code == 202
    said = {**answer.json()["spec"], "name": answer.json()["name"], "priority": answer.json()["priority"]}
    assert said.items() >= spec(dataset, **changes).items()


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"rows": "5:1"}, "invalid-record", "has samples 0 to 199: rows 5:1 are not a part of it"),
        ({"rows": "100:900"}, "invalid-record", "rows 100:900 are not a part of it"),
        ({"rows": "0:20"}, "invalid-record", "20 samples, from line 2 to line 21, are too few"),
        ({"rows": "a:b"}, "invalid-request", "/rows: cannot read the rows 'a:b': write START:STOP"),
        ({"dt": 0.02}, "invalid-record", "the sampling time is 0.01 s by column t_s and 0.02 s"),
        ({"dt": -0.01}, "invalid-request", "/dt: Input should be greater than 0"),
        ({"inputs": ["u_V"] * 17}, "invalid-request", "/inputs: Tuple should have at most 16 items"),
        ({"inputs": ["u_V", "u_V+1"]}, "invalid-record", "column u_V is given as an input twice"),
        ({"inputs": ["u_V+2"]}, "invalid-record", "has no column u_V+2"),
        ({"inputs": ["t_s"]}, "invalid-record", "y_um is a static curve over t_s: the file has no time"),
        ({"inputs": []}, "invalid-request", "/inputs: Tuple should have at least 1 item"),
        (
            {"settings": {"population": 100_000, "islands": 256, "generations": 1}},
            "invalid-settings",
            "256 islands of 100000 individuals need about 292 GB of memory",
        ),
        ({"output": "u_V"}, "invalid-record", "column u_V is given as input and as output"),
        ({"output": 'y"\n'}, "invalid-record", "record.csv has no column"),
        ({"seed": -1}, "invalid-request", "/seed: Input should be greater than or equal to 0"),
        ({"seed": 2**63}, "invalid-request", "/seed: Input should be less than 9223372036854775808"),
        ({"priority": 101}, "invalid-request", "/priority: Input should be less than or equal to 100"),
        ({"name": "a\0b"}, "invalid-request", "/name: String should match pattern"),
        ({"settings": {"topology": "0>1," * 200_000}}, "invalid-settings", "topology has 800000 characters"),
        ({"settings": {"shifts": [10**9]}}, "invalid-settings", "back-shifts are at most 1000"),
        ({"settings": {"library_degree": 50}}, "invalid-settings", "library_degree is at most 8"),
        ({"settings": {"tolerance": 10**399}}, "invalid-request", "/settings/tolerance: "),
        ({"validation": {"dataset": "0-csv"}}, "no-such-dataset", "there is no data set '0-csv'"),
    ],
)
def test_an_invalid_job_is_rejected_with_instructions(service, dataset, changes, kind, words):
    before = service.client.get("/v1/jobs").json()
    answer = service.submit(**spec(dataset, **changes))
    assert words in problem_of(answer, 404 if kind == "no-such-dataset" else 422, kind)
    assert service.client.get("/v1/jobs").json() == before


@pytest.mark.ci
def test_columns_with_unusual_names_are_accepted(service):
    header = ",".join('"' + name.replace('"', '""') + '"' for name in UNUSUAL_NAMES)
    lines = [
        ",".join(str((k * (index + 3)) % 7 + k % 3) for index in range(len(UNUSUAL_NAMES))) for k in range(60)
    ]
    stored = service.upload("\n".join([header, *lines]).encode()).json()
    assert [column["name"] for column in stored["preview"]["columns"]] == UNUSUAL_NAMES
    order = {"dataset": stored["id"], "inputs": UNUSUAL_NAMES[2:], "output": UNUSUAL_NAMES[1], "dt": 0.1}
    answer = service.submit(**order, settings={"library": ""})
    assert answer.status_code == 202, answer.text
    assert answer.json()["spec"]["inputs"] == UNUSUAL_NAMES[2:]
    assert service.client.get(answer.headers["location"]).json()["spec"] == answer.json()["spec"]


@pytest.mark.ci
def test_columns_of_two_recordings_cannot_be_combined(service):
    """The columns are valid, but those of different recordings have different lengths."""
    names = ("u", "y", "v", "z")
    arrays = {
        name: [k % (index + 3) for k in range(60 if index < 2 else 90)] for index, name in enumerate(names)
    }
    dataset = service.upload(npz(**arrays, dt=0.1), "two.npz").json()["id"]
    for inputs, output in ((["u"], "y"), (["v"], "z")):
        assert service.submit(dataset=dataset, inputs=inputs, output=output).status_code == 202
    answer = service.submit(dataset=dataset, inputs=["u"], output="z")
    assert "the channels of a record must have equal length" in problem_of(answer, 422, "invalid-record")
