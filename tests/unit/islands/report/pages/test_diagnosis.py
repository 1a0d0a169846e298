"""Sentences of the diagnosis report."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

import islands
from islands.diagnosis.discovery.missing_terms import Discovery
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.report.pages.diagnosis import diagnosis_report
from islands.report.pages.origin import Origin

EQUATIONS = Discovery("dx/dt = -x + a1*x**3; a1 = 0.2", ("jump",), ("cubic-stiffness",), 2.0)


@pytest.fixture(scope="module")
def diagnosis() -> Diagnosis:
    """A delay of three samples that a linear simulation lacks."""
    rng = np.random.default_rng(0)
    u = scipy.signal.lfilter([0.1], [1.0, -0.9], rng.standard_normal(600))
    y = scipy.signal.lfilter([0.3], [1.0, -0.7], np.roll(u, 3)) + 0.02 * rng.standard_normal(600)
    return islands.diagnose(islands.Dataset(u[:, None], y, 0.01), "linear:1")


def summarise(found: Diagnosis) -> str:
    return DiagnosisResult.from_diagnosis(found).summary


@pytest.mark.nightly
def test_report_shows_equations_as_the_cause_or_as_an_equivalent_of_it(diagnosis: Diagnosis) -> None:
    # Without an extension, the equations of the terms are all that is known.
    as_cause = replace(diagnosis, verdict=Verdict.DISCOVERED, discovery=EQUATIONS, trial=None)
    as_equivalent = replace(diagnosis, verdict=Verdict.NAMED, discovery=EQUATIONS)
    given = as_cause, as_equivalent, replace(diagnosis, discovery=None)
    for texts in (
        [summarise(each) for each in given],
        [diagnosis_report(Origin("record"), each).decode() for each in given],
    ):
        assert ["a1*x**3" in text for text in texts] == [True, True, False]
        assert ["explain the record as well" in text for text in texts] == [False, True, False]
        assert ["instead of the terms" in text for text in texts] == [True, False, False]
        assert ["with jump of the output" in text for text in texts] == [False, True, False]


@pytest.mark.ci
def test_report_typesets_the_extended_simulation_and_states_its_values(diagnosis: Diagnosis) -> None:
    page = diagnosis_report(Origin("record"), diagnosis).decode()
    (equations,) = re.findall(r'<div class="equation"><math .*?</math></div>', page, re.DOTALL)
    assert all(part in equations for part in ("<mi>G</mi>", "<mi>tau</mi>", "<mi>output</mi>"))
    assert re.search(r"Its values: .*tau = 0\.0\d+ s \(", page)
    assert "Extended simulation: output = G[u(t - tau)]." in summarise(diagnosis).replace("\n    ", " ")
    assert "delay of the input (<code>delay</code>)" in page


@pytest.mark.ci
def test_noise_alone_is_no_discrepancy_and_no_cause(diagnosis: Diagnosis) -> None:
    (cause,) = diagnosis.causes
    noise = replace(cause, name="coloured-noise", explained_fraction=None)
    both = replace(diagnosis, effects=(cause, noise))
    assert (both.causes, both.noise) == ((cause,), (noise,))
    alone = replace(diagnosis, verdict=Verdict.NOTHING, effects=(noise,))
    assert summarise(alone).startswith("No significant discrepancy")
    assert "Sampling and noise: coloured-noise: " in summarise(alone)
    assert "Sampling and noise" not in summarise(replace(alone, effects=()))
