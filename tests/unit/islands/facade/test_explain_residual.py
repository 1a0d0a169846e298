"""Formula of a residual: names of the record, and no formula of rounding errors."""

from types import SimpleNamespace
from warnings import warn

import numpy as np
import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.errors import ExtrapolationWarning
from islands.expressions.parsing import parse
from islands.facade import explain_residual as module
from islands.models.narx import make_model
from islands.records.dataset import Dataset

RNG = np.random.default_rng(3)
INPUT = RNG.standard_normal(200)


def diagnosis(residual):
    """Return a stub of a diagnosis whose simulation leaves a residual."""
    record = Dataset(
        INPUT[:, None], INPUT + residual, 0.1, ("voltage [V]",), "speed [rad/s]", ("V",), "rad/s"
    )
    best = SimpleNamespace(output=INPUT)
    return SimpleNamespace(verdict=Verdict.UNKNOWN, record=record, best=best, estimation_samples=150)


@pytest.fixture(autouse=True)
def searched(monkeypatch):
    """Replace the search by a regression on the past sample of the two inputs, which are equal."""

    def search(dataset, *_args, **_settings):
        warn("the residual extrapolates", ExtrapolationWarning, stacklevel=2)  # of no use to the caller
        gain = np.linalg.lstsq(dataset.u[:-1, :1], dataset.y[1:], rcond=None)[0].item()
        terms = [(parse("u1(k-1)"), gain / 3.0), (parse("u2(k-1)"), 2.0 * gain / 3.0)]
        model = make_model(terms, dataset.input_names, dataset.output_name)
        return SimpleNamespace(models=[SimpleNamespace(model=model)])

    monkeypatch.setattr("islands.facade.identify.identify_record", search)


def test_a_formula_has_the_names_of_the_record():
    found = module.explain_residual(diagnosis(0.75 * np.r_[0.0, INPUT[:-1]]))
    assert found.formula == "residual(k) = 0.25*voltage(k-1) + 0.5*simulated(k-1)"
    assert found.explains == pytest.approx(1.0)


def test_rounding_errors_have_no_formula():
    assert module.explain_residual(diagnosis(1e-12 * np.r_[0.0, INPUT[:-1]])) is None


def test_time_left_follows_from_the_pace_of_the_search():
    progress = module.FormulaProgress()
    found = []
    for now, generation in ((100.0, 10), (104.0, 20), (112.0, 30)):
        state = SimpleNamespace(archipelago=SimpleNamespace(generation=generation))
        found.append(progress.measure(state, SimpleNamespace(generations=40), now))
    assert [left for _, left in found] == [None, 8.0, 6.0]
    fractions = [fraction for fraction, _ in found]
    assert fractions == sorted(fractions)
    assert all(module.BEFORE_FORMULA < each < module.BEFORE_REPORT for each in fractions)
