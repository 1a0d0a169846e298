"""Figures of a job: one that fails leaves the others."""

import numpy as np
import pytest

import islands
from islands.report.figures import registry
from islands_service import figure_worker


def fail(*_arguments):
    raise ArithmeticError("the figure fails")


@pytest.mark.ci
def test_a_figure_that_fails_states_the_reason(monkeypatch):
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-1.0, 1.0, 60), 4)
    y = np.convolve(u**2, 0.5 * 0.8 ** np.arange(40))[: u.size] + 0.01 * rng.standard_normal(u.size)
    found = islands.fit(u, y, 0.1, library="polynomial", degree=2, lags=1, max_terms=2).search_result
    monkeypatch.setattr(figure_worker, "FIGURES", {**registry.FIGURES, "residuals": fail})
    rank = found.recommendation.rank
    made = {name: data.decode() for name, data in figure_worker.render_model_figures(found, rank).items()}
    failed = {name for name, text in made.items() if "Not computed: ArithmeticError" in text}
    assert failed == {f"{rank}/residuals.svg", f"{rank}/residuals.csv"}
    assert "<path" in made[f"{rank}/free-run.svg"]
