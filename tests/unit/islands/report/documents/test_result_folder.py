"""Result folder: all fields of the contract, only JSON numbers, no files of earlier results."""

import json
from dataclasses import asdict, replace
from math import inf, nan

import numpy as np
import pytest

import islands
from islands.persistence.models import read_model
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document, result_json, write_result
from islands.report.text.summary import summary
from islands.simulation.outcome import EvaluationOutcome, Status
from support.assessments import with_changes

LOST = EvaluationOutcome(Status.DIVERGED, "|y| left 1e+06 at sample 17")


def record(samples=300, seed=0, **changes):
    rng = np.random.default_rng(seed)
    u, y = np.cumsum(rng.normal(size=samples)) / 5, np.zeros(samples)
    for k in range(2, samples):
        y[k] = y[k - 1] + 0.5 * (u[k - 1] - u[k - 2]) - 0.1 * y[k - 1] * abs(u[k - 1] - u[k - 2])
    y += 0.01 * rng.normal(size=samples)
    return Dataset(u, y, **({"dt": 0.1} | changes))


@pytest.fixture(scope="module")
def findings():
    data = record(input_names=("u_V",), output_name="y_um", input_units=("V",), output_unit="um")
    return islands.fit(data, library="phi-polynomial", max_terms=4, seed=7).with_wall_time(0.5).search_result


def refuse(word):
    raise AssertionError(f"{word} is no JSON")


def loaded(findings):
    return json.loads(result_json(findings), parse_constant=refuse)


def with_best(findings, **changes):
    """Return the result with changed fields of the best model."""
    best, *others = findings.models
    return replace(findings, models=(with_changes(best, **changes), *others))


# The contract: the fields that issue 2 lists, and those that docs/reference/result-json.md adds.


def test_a_result_names_the_recommended_model_with_reasons(findings):
    result = loaded(findings)
    found = findings.recommendation
    assert result["recommended"] == json.loads(json.dumps(asdict(found)))
    assert found.excluded
    assert [model["rank"] for model in result["models"] if model["recommended"]] == [found.rank]


def test_numbers_that_json_cannot_represent_become_null(findings):
    best = findings.models[0]
    lost = replace(best.metrics["validation"]["free_run"], mape=nan, r2=-inf, rmse=inf)
    metrics = {**best.metrics, "validation": {**best.metrics["validation"], "free_run": lost}}
    outcomes = {**best.outcomes, "validation": {**best.outcomes["validation"], "free_run": LOST}}
    holds = (replace(best.physics.holds[0], bounded=False, drift_percent=inf), *best.physics.holds[1:])
    changed = with_best(
        findings,
        metrics=metrics,
        outcomes=outcomes,
        information=replace(best.information, aic=-inf, bic=nan),
        physics=replace(best.physics, holds=holds),
    )
    model = loaded(changed)["models"][0]
    found = model["metrics"]["validation"]["free_run"]
    assert (found["mape"], found["r2"], found["rmse"]) == (None, None, None)
    assert found["fit_percent"] == lost.fit_percent
    assert model["outcomes"]["validation"]["free_run"].startswith("diverged: |y| left 1e+06 at sample 17; ")
    assert (model["information"]["aic"], model["information"]["bic"]) == (None, None)
    assert model["physics"]["hold_drift_percent"] is None
    assert model["physics"]["holds"][0]["drift_percent"] is None
    assert model["physics"]["property_1"] is False


# The record's hash.


# The folder.


def test_the_folder_has_a_file_per_model_a_summary_and_a_result(findings, tmp_path):
    write_result(findings, tmp_path / "out")
    files = sorted(str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.*"))
    assert files == [
        "method.txt",
        *(f"models/0{rank}.json" for rank in range(1, 5)),
        *("result.json", "summary.txt"),
    ]
    for rank, entry in enumerate(findings.models, start=1):
        assert read_model(tmp_path / "out" / "models" / f"0{rank}.json") == entry.model
    assert (tmp_path / "out" / "result.json").read_text() == result_json(findings)
    assert (tmp_path / "out" / "summary.txt").read_text() == summary(
        result_document(findings), findings.recommended.model
    )


def test_only_the_models_of_an_earlier_result_are_removed(findings, tmp_path):
    write_result(findings, tmp_path)
    (tmp_path / "models" / "mine.json").write_text("{}")
    write_result(replace(findings, models=findings.models[:2]), tmp_path)
    assert sorted(path.name for path in (tmp_path / "models").iterdir()) == [
        "01.json",
        "02.json",
        "mine.json",
    ]
    assert len(json.loads((tmp_path / "result.json").read_text())["models"]) == 2


def test_model_files_do_not_depend_on_the_folder_or_the_clock(findings, tmp_path, monkeypatch):
    for name, seconds in (("here", 1.0), ("there", 2.0)):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        write_result(replace(findings, search=replace(findings.search, wall_s=seconds)), tmp_path / name)
    names = ["summary.txt", "method.txt", *(f"models/0{rank}.json" for rank in range(1, 5))]
    for name in names:
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()
    assert str(tmp_path) not in "".join((tmp_path / "here" / name).read_text() for name in names)
