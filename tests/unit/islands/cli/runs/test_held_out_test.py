"""Errors on test data: metrics of a simulation, none after a divergence."""

import json

import numpy as np

from islands.cli.runs.held_out_test import evaluate_test
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.identify_runs import record


def test_diverging_test_has_an_outcome_and_no_metrics(tmp_path, capsys):
    class Diverging:
        best = property(lambda self: self)

        def simulate(self, test_data):
            return free_run(self.model, test_data)

    result = Diverging()
    result.model = make_model([(parse("y(k-1)"), 2.0)])
    evaluate_test(result, record(), tmp_path)
    document = json.loads((tmp_path / "test.json").read_text())
    assert list(document) == ["outcome"]
    assert document["outcome"].startswith("diverged: |y| left")
    assert "MAPE" not in capsys.readouterr().out
    result.model = make_model([(parse("y(k-1)"), 1.0)])
    still = record()
    evaluate_test(result, Dataset(still.u, np.ones(700), 0.01), tmp_path)
    document = json.loads((tmp_path / "test.json").read_text())
    assert (document["mape"], document["rmse"]) == (None, 0.0)
