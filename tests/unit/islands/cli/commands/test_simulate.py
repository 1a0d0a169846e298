"""``islands simulate``: the error beside that of the model."""

import re

import pytest

import islands
from islands.records.writer import write_record
from support.identifications import record as make_record


@pytest.mark.ci
def test_the_error_on_a_record_is_compared_with_that_on_the_validation_data(command_line, tmp_path):
    record = make_record(300)
    write_record(record, tmp_path / "r.csv")
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 1, "certificate": 0}
    result = islands.fit(record, average=1, **settings)
    folder = result.save(tmp_path / "result", figures=())
    code, out, _ = command_line("simulate", folder, tmp_path / "r.csv")
    rmse, times = re.search(r"RMSE (\S+) .*\n(\S+) times the RMSE on the validation data", out).groups()
    expected = result.best.metrics["validation"]["free_run"].rmse
    assert (code, float(rmse) / float(times)) == (0, pytest.approx(expected, rel=0.01))
    (tmp_path / "model.json").write_bytes((folder / "models/01.json").read_bytes())
    code, out, _ = command_line("simulate", tmp_path / "model.json", tmp_path / "r.csv")
    assert (code, "RMSE" in out, "times the RMSE" in out) == (0, True, False)
