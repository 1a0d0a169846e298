"""`validate_job`: decisions from previews, and the inspections that remain."""

import json
from types import SimpleNamespace

import pytest

from islands.errors import RecordError, SettingsError
from islands_service.domain.job_spec import Identification
from islands_service.intake.file_inspection import InspectionRequest
from islands_service.intake.job_validation import validate_job
from islands_service.settings import ServiceSettings
from islands_service.store.datasets import DatasetNotFoundError, StoredDataset
from support.service import spec

ONE, OTHER = "0" * 32 + "-csv", "1" * 32 + "-csv"


def dataset(identity=ONE, time="t_s", dt=0.01, warnings=(), **columns):
    """A data set with columns, each given by its number of samples or by its problem."""
    columns = {"t_s": 100, "u_V": 100, "y_um": 100, **columns}
    preview = {
        "columns": [
            {
                "name": name,
                "samples": found if isinstance(found, int) else None,
                "problem": found if isinstance(found, str) else "",
            }
            for name, found in columns.items()
        ],
        "time": time,
        "dt": dt,
        "warnings": list(warnings),
    }
    return StoredDataset(
        "me", identity, "a.csv", ".csv", identity[:32] * 2, 7, json.loads(json.dumps(preview)), 0.0
    )


def pending_inspections(*datasets, **changes):
    """Return the pending inspections of a job on data sets."""
    return validated(*datasets, **changes).inspections


def validated(*datasets, **changes):
    known = {each.id: each for each in datasets}

    def get(owner, identity):
        if owner != "me" or identity not in known:
            raise DatasetNotFoundError(identity)
        return known[identity]

    store = SimpleNamespace(datasets=SimpleNamespace(get=get))
    order = Identification.model_validate(spec(ONE, **changes))
    return validate_job(order, "me", store, ServiceSettings())


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
def test_record_with_an_insufficient_preview_is_inspected(record, changes):
    (pending,) = pending_inspections(record, **changes)
    inputs = tuple(changes.get("inputs", ["u_V"]))
    asked = InspectionRequest(inputs, changes.get("output", "y_um"), changes.get("dt"), changes.get("rows"))
    assert (pending.dataset, pending.request) == (record, asked)


@pytest.mark.parametrize("other", [ONE, ONE.replace("csv", "txt")])
def test_data_set_with_the_same_file_is_refused_for_validation(other):
    with pytest.raises(SettingsError, match="recordings or validation data share samples"):
        pending_inspections(dataset(), dataset(other), validation={"dataset": other})
    rows = {"rows": "0:60", "validation": {"dataset": other, "rows": "60:"}}
    assert len(pending_inspections(dataset(), dataset(other), **rows)) == 2


def test_recordings_are_checked_and_must_not_share_samples():
    recordings = {"recordings": [{"dataset": OTHER}]}
    assert pending_inspections(dataset(), dataset(OTHER), **recordings) == ()
    (pending,) = pending_inspections(dataset(), dataset(OTHER, y_um="NaN in line 7"), **recordings)
    assert pending.dataset.id == OTHER
    shared = {"recordings": [{"dataset": OTHER}, {"dataset": OTHER, "rows": "50:"}]}
    with pytest.raises(SettingsError, match="recordings or validation data share samples"):
        pending_inspections(dataset(), dataset(OTHER), **shared)
    with pytest.raises(RecordError, match=r"0\.01 s, the data set a\.csv of 0\.02 s: resample"):
        pending_inspections(dataset(), dataset(OTHER, dt=0.02), **recordings)


def test_data_sets_with_different_sampling_times_are_refused():
    validation = {"validation": {"dataset": OTHER}}
    with pytest.raises(RecordError, match=r"0\.01 s, the data set a\.csv of 0\.02 s: resample"):
        pending_inspections(dataset(), dataset(OTHER, dt=0.02), **validation)
    for other in (dataset(OTHER, dt=0.010001), dataset(OTHER, dt=None)):
        assert len(pending_inspections(dataset(), other, **validation)) == (other.preview["dt"] is None)
    assert len(pending_inspections(dataset(), dataset(OTHER, dt=0.02), dt=0.01, **validation)) == 2


def test_validation_record_is_checked_like_the_estimation_record():
    other = dataset(OTHER, y_um="NaN in line 7")
    (pending,) = pending_inspections(dataset(), other, validation={"dataset": OTHER})
    assert pending.dataset == other
    (pending,) = pending_inspections(dataset(), dataset(OTHER), validation={"dataset": OTHER, "rows": "5:"})
    assert (pending.dataset.id, pending.request.rows) == (OTHER, "5:")
    with pytest.raises(DatasetNotFoundError):
        pending_inspections(dataset(), validation={"dataset": OTHER})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": "y"}, "a.csv has no column y; it has t_s, u_V, y_um"),
        ({"inputs": ["u_v"]}, "Did you mean 'u_V'?"),
        ({"inputs": ["u_V", "u_V"]}, "given as an input twice"),
        ({"inputs": ["u_V", "u_V+1"]}, "given as an input twice"),
        ({"inputs": ["y_um"]}, "given as input and as output"),
        ({"inputs": ["y_um+1"]}, "given as input and as output"),
        ({"inputs": ["u_V+2"]}, "has no column u_V+2"),
        ({"inputs": ["u\n'\"V"]}, "has no column"),
    ],
)
def test_invalid_choice_of_columns_is_refused(changes, words):
    with pytest.raises(RecordError) as refused:
        pending_inspections(dataset(), **changes)
    assert words in str(refused.value)
