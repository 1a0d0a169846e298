"""A step after the answer never takes the answer away: each of them fails here, one at a time."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import islands
import islands.facade.library_fit
import islands.facade.results.identification
import islands.report.documents.result_folder
from islands import export
from islands.estimation.structure_selection.certificate import SubsetSearch
from islands.evolution import search_result
from islands.facade import final_models, refit
from islands.facade.coupled import bands as coupled_bands
from islands.facade.coupled import identification, joint_models
from islands.facade.fit import fit_record
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.identification import Result
from islands.report.documents.result_folder import write_interim_result
from islands.report.figures import model_responses, registry
from islands.report.figures.names import ALL_FIGURES
from islands.report.text.facts import ResultFacts
from islands.validation import assessment
from islands.validation.coupled_assessment import CoupledAssessment

#: The laws of `Steps` are in the unit tests.
pytestmark = pytest.mark.ci


class InjectedError(ArithmeticError):
    """The failure of the tests."""


def fail(*_arguments, **_options):
    raise InjectedError("the step fails")


def make_record(samples=240):
    """Return a record of a plant whose linear model differs from the recommended one."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-1.0, 1.0, samples // 4), 4)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.8 * y[k - 1] + 0.5 * u[k - 1] + 0.4 * u[k - 1] ** 2
    return islands.Dataset(u=u, y=y + 0.01 * rng.standard_normal(samples), dt=0.1)


def fit(record, **options):
    return islands.fit(record, library="polynomial", degree=2, lags=1, max_terms=4, **options)


#: Step as named in the result, the object that computes it, and its attribute.
STEPS = {
    "linear model": (search_result, "assess_linear_model"),
    "prediction bands": (search_result, "calibrate_bands"),
    "bounds of the errors of all models": (SubsetSearch, "certify"),
    "estimation by the error of the free run": (islands.facade.library_fit, "refine_models"),
    "estimation of the parameters on all data": (refit, "refit"),
    "residual tests": (assessment, "assess_residual"),
    "physics checks": (assessment, "check_physics"),
    "facts about the data": (islands.report.documents.result_folder, "measure_output_noise"),
    "summary.txt": (islands.report.documents.result_folder, "summary"),
    "method.txt": (islands.report.documents.result_folder, "method_text"),
    "figures": (registry, "search_figures"),
    "figures of responses": (model_responses, "draw_responses"),
}


@pytest.mark.parametrize("step", STEPS)
def test_a_step_that_fails_leaves_a_line_and_the_models(step, monkeypatch, tmp_path):
    monkeypatch.setattr(*STEPS[step], fail)
    result = fit(make_record(), refit="all")
    folder = result.save(tmp_path / "result", figures=ALL_FIGURES if "figure" in step else ())
    document = json.loads((folder / "result.json").read_text())
    reasons = {each["step"]: each["reason"] for each in document["not_computed"]}
    assert reasons[step].startswith("InjectedError: the step fails (test_optional_steps.py, line")
    assert f"Not computed: {step}: InjectedError" in " ".join(
        (folder / "summary.txt").read_text().split()
    ) or (step == "method.txt" and "Not computed" in (folder / "method.txt").read_text())
    loaded = islands.load(folder)
    assert loaded.best.metrics["validation"]["free_run"].r2 > 0.99
    assert not np.isnan(loaded.simulate(make_record()).y[10:]).any()


@pytest.mark.parametrize("name", ["free-run", "residuals", "front", "record"])
def test_a_figure_that_fails_leaves_the_others(name, monkeypatch, tmp_path):
    table = "SEARCH_FIGURES" if name in registry.SEARCH_FIGURES else "FIGURES"
    monkeypatch.setattr(registry, table, {**getattr(registry, table), name: fail})
    folder = fit(make_record()).save(tmp_path / "result", figures=ALL_FIGURES)
    drawn = {path.stem for path in (folder / "figures").glob("*.svg")}
    assert name not in drawn
    assert {"free-run", "residuals", "front", "record"} - {name} <= drawn
    assert f"Not computed: figure {name}: InjectedError" in (folder / "summary.txt").read_text()


def test_a_sentence_that_fails_leaves_the_others(monkeypatch):
    result = fit(make_record())
    before, failing, after = re.split("^(?=Physics:|Fails at:)", str(result), flags=re.MULTILINE)
    monkeypatch.setattr(ResultFacts, "friction", property(fail))
    text = str(result)
    assert failing not in text
    assert text.startswith(f"{before}(not computed: physics: InjectedError")
    assert text.endswith(after)


def test_a_model_whose_checks_fail_claims_nothing_about_them(monkeypatch):
    monkeypatch.setattr(assessment, "check_physics", fail)
    monkeypatch.setattr(assessment, "assess_residual", fail)
    text = str(fit(make_record()))
    assert "bounded at" not in text
    assert "As a simulation: good" not in text
    assert "Fails at: physics checks and residual tests: not computed." in text
    assert "no structure is left" not in text
    assert "is predictable" not in text


def test_the_models_are_stored_before_the_optional_steps(monkeypatch, tmp_path):
    class EndOfProcess(BaseException):
        """The process ends, as by a lack of memory."""

    def end(*_arguments):
        raise EndOfProcess

    monkeypatch.setattr(search_result, "calibrate_bands", end)
    record, folder = make_record(), tmp_path / "result"
    with pytest.raises(EndOfProcess):
        fit_record(
            *(record, 0.25),
            library="polynomial",
            degree=2,
            lags=1,
            on_models=lambda found: write_interim_result(found, folder),
        )
    loaded = islands.load(folder)
    assert loaded.best.metrics["validation"]["free_run"].r2 > 0.99
    assert "Not computed: prediction bands: the command ended before this step." in str(loaded)
    assert not np.isnan(loaded.simulate(record).y[10:]).any()


@pytest.mark.parametrize("step", ["standard errors", "refinement of parameters"])
def test_a_final_step_of_an_evolution_may_fail(step, monkeypatch):
    steps = {"standard errors": "_with_standard_errors", "refinement of parameters": "_refine"}
    monkeypatch.setattr(final_models, steps[step], fail)
    result = islands.identify(make_record(), preset="narx", islands=1, generations=1, population=20)
    assert isinstance(result, Result)
    assert step in result.search_result.search.not_computed


#: Optional steps of a result of two outputs.
COUPLED_STEPS = {
    "prediction bands": (coupled_bands, "make_ensemble"),
    "refinement of all equations": (identification, "_refine"),
    "residual tests of y": (CoupledAssessment, "measure_residual"),
    "figure free-run-1": (FittedModel, "plot"),
    "linear model": (joint_models, "identify_joint_model"),
}


@pytest.mark.parametrize("step", COUPLED_STEPS)
def test_a_step_of_several_outputs_that_fails_leaves_a_line_and_the_model(step, monkeypatch, tmp_path):
    record = make_record()
    frame = {"u": record.u[:, 0], "y": record.y, "z": 1.0 + 2.0 * record.y + record.u[:, 0] ** 3}
    monkeypatch.setattr(*COUPLED_STEPS[step], fail)
    result = islands.fit(
        pd.DataFrame(frame), inputs="u", output=("y", "z"), dt=0.1, degree=2, lags=1, max_terms=4
    )
    folder = result.save(tmp_path / "result")
    document = json.loads((folder / "result.json").read_text())
    assert step in {each["step"] for each in document["not_computed"]}
    assert f"Not computed: {step}: InjectedError" in " ".join((folder / "summary.txt").read_text().split())
    assert islands.load(folder).best.equation == result.best.equation


def test_an_export_that_fails_states_the_reason_and_leaves_the_file(monkeypatch, tmp_path):
    result = fit(make_record())
    path = tmp_path / "model.c"
    result.export("c", path)
    before = path.read_bytes()
    monkeypatch.setattr(export, "EXPORTS", {**export.EXPORTS, "c": fail})
    with pytest.raises(islands.ModelError, match="the export as c is not computed"):
        result.export("c", path)
    assert path.read_bytes() == before
