"""Admission: what a preview settles is settled by it, and what it leaves open is read once more."""

import json
from types import SimpleNamespace

import pytest

from islands.errors import RecordError
from islands_service.domain.job_spec import Identification
from islands_service.intake.file_inspection import InspectionRequest
from islands_service.intake.job_validation import validate_job
from islands_service.settings import ServiceSettings
from islands_service.store.datasets import DatasetNotFoundError, StoredDataset
from support.service import spec

ONE, OTHER = "0" * 32 + "-csv", "1" * 32 + "-csv"


def dataset(identity=ONE, time="t_s", dt=0.01, warnings=(), **columns):
    """A data set with columns; of each its samples, or its problem."""
    columns = {"t_s": 100, "u_V": 100, "y_um": 100, **columns}
    preview = {
        "columns": [
            {
                "name": name,
                "samples": told if isinstance(told, int) else None,
                "problem": told if isinstance(told, str) else "",
            }
            for name, told in columns.items()
        ],
        "time": time,
        "dt": dt,
        "warnings": list(warnings),
    }
    return StoredDataset("me", identity, "a.csv", ".csv", "b" * 64, 7, json.loads(json.dumps(preview)), 0.0)


def doubts(*datasets, **changes):
    """What stays open of a job on data sets."""
    known = {each.id: each for each in datasets}

    def get(owner, identity):
        if owner != "me" or identity not in known:
            raise DatasetNotFoundError(identity)
        return known[identity]

    store = SimpleNamespace(datasets=SimpleNamespace(get=get))
    order = Identification.model_validate(spec(ONE, **changes))
    return validate_job(order, "me", store, ServiceSettings())


def test_a_clean_record_leaves_nothing_open():
    assert doubts(dataset()) == ()
    assert doubts(dataset(), inputs=["u_V+1"]) == ()
    assert doubts(dataset(v_V="broken"), settings={"islands": 3}, seed=4) == ()
    assert doubts(dataset(), dataset(OTHER), validation={"dataset": OTHER}) == ()


@pytest.mark.parametrize(
    ("record", "changes"),
    [
        (dataset(), {"rows": "0:50"}),
        (dataset(), {"dt": 0.01}),
        (dataset(dt=None), {}),
        (dataset(y_um="NaN in line 7"), {}),
        (dataset(u_V="NaN in line 7"), {}),
        (dataset(y_um=90), {}),
        (dataset(warnings=["the comma in a.csv, line 2, column t_s is read as a decimal mark"]), {}),
        (dataset(), {"inputs": ["t_s"]}),
        (dataset(**{"run.u": 100, "run.y": 100}), {"inputs": ["run.u"], "output": "run.y"}),
    ],
)
def test_what_a_preview_cannot_settle_is_read_as_the_job_would(record, changes):
    (doubt,) = doubts(record, **changes)
    inputs = tuple(changes.get("inputs", ["u_V"]))
    asked = InspectionRequest(inputs, changes.get("output", "y_um"), changes.get("dt"), changes.get("rows"))
    assert (doubt.dataset, doubt.request) == (record, asked)


def test_a_validation_record_is_looked_at_like_the_first():
    other = dataset(OTHER, y_um="NaN in line 7")
    (doubt,) = doubts(dataset(), other, validation={"dataset": OTHER})
    assert doubt.dataset == other
    (doubt,) = doubts(dataset(), dataset(OTHER), validation={"dataset": OTHER, "rows": "5:"})
    assert (doubt.dataset.id, doubt.request.rows) == (OTHER, "5:")
    with pytest.raises(DatasetNotFoundError):
        doubts(dataset(), validation={"dataset": OTHER})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": "y"}, "a.csv has no column y; it has t_s, u_V, y_um"),
        ({"inputs": ["u_v"]}, "Did you mean u_V?"),
        ({"inputs": ["u_V", "u_V"]}, "given as an input twice"),
        ({"inputs": ["u_V", "u_V+1"]}, "given as an input twice"),
        ({"inputs": ["y_um"]}, "given as input and as output"),
        ({"inputs": ["y_um+1"]}, "given as input and as output"),
        ({"inputs": ["u_V+2"]}, "has no column u_V+2"),
        ({"inputs": ["u\n'\"V"]}, "has no column"),
    ],
)
def test_a_choice_that_the_columns_cannot_serve_is_refused(changes, words):
    with pytest.raises(RecordError) as refused:
        doubts(dataset(), **changes)
    assert words in str(refused.value)
