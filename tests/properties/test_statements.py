"""Properties of the sentences about a result: no two of them contradict each other."""

from dataclasses import replace
from functools import cache
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

import islands
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.report.documents.result_folder import finite, residual_structure_document, result_document
from islands.report.pages.identification import identification_report
from islands.report.pages.origin import Origin
from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.statements import describe, describe_diagnosis
from islands.report.text.summary import summary
from islands.sentences import write
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.validation.ensemble import Ensemble
from islands.validation.metrics import Metrics
from islands.validation.predictable_residual import VERDICTS, ResidualStructure
from support.assessments import with_changes
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.diagnosis_documents import CAUSE, GAIN, make_document
from support.searches import record
from support.stated_results import list_texts, make_cases
from support.statements import find_contradictions

OK = EvaluationOutcome(Status.OK, "")
LOST = EvaluationOutcome(Status.DIVERGED, "at sample 17")

#: Shares, fractions and ratios on both sides of every limit of the sentences.
SHARES = st.sampled_from([0.0, 0.05, 0.0999, 0.1001, 0.3, 0.939, 1.0])
RMSES = st.sampled_from([1e-16, 3e-16, 0.01, 0.015, 0.1, 1.0])


@cache
def found():
    data = record(300)
    named = Dataset(data.u, data.y, 0.1, ("u_V",), "y_um", ("V",), "um")
    return islands.fit(named, library="phi-polynomial", max_terms=4, seed=7).search_result


#: Measured quantities that the sentences state.
CHOICES = st.fixed_dictionaries(
    {
        "lost": st.booleans(),
        "shares": st.tuples(SHARES, SHARES),
        "percent": st.sampled_from([1e-6, 0.5, 1.5]),
        "r2": st.tuples(*[st.sampled_from([-0.01, 0.3, 0.95])] * 2),
        "rmse": st.tuples(*[RMSES] * 3),
        "bounded": st.tuples(*[st.sampled_from([True, True, True, False])] * 3),
        "constant": st.booleans(),
        "extremes": st.tuples(*[st.sampled_from([0.0, 3.0, 500.0, inf])] * 4),
        "coverage": st.sampled_from([None, 0.5, 0.74, 0.76, 0.9]),
        "widening": st.sampled_from([1.0, 3.0]),
        "ensemble": st.sampled_from(["none", "certain", "doubtful"]),
        "noise": st.sampled_from([None, 0.01, 0.1]),
    }
)


def make_structure(shares, percent, lost):
    """Return a structure of a residual with the verdict of its numbers, as `measure_structure` gives it."""
    adequate, minor, inadequate = VERDICTS
    if lost:
        return ResidualStructure(shares[0], nan, nan, inadequate)
    verdict = adequate if shares[1] <= 0.1 or percent <= 1e-5 else minor if percent <= 1.0 else inadequate
    return ResidualStructure(*shares, percent, verdict)


def make_physics(physics, bounded, constant, extremes):
    """Return checks of which the first hold, or an excursion, or some extremes fail."""
    first, *holds = physics.holds
    minor, *others = physics.excursions
    changed = replace(first, bounded=bounded[0], constant=bounded[0] and constant, drift_percent=7.5)
    pairs = zip(physics.extremes, extremes, strict=True)
    return replace(
        physics,
        holds=(changed, *holds),
        excursions=(
            replace(minor, bounded=bounded[1]),
            *others[:-1],
            replace(others[-1], bounded=bounded[2]),
        ),
        extremes=tuple(replace(each, bounded=far < inf, ranges=far) for each, far in pairs),
    )


def make_result(choices):
    """Return a result with one model that has the chosen quantities."""
    base = found()
    entry, parts, lost = base.recommended, base.split, choices["lost"]
    free, one, trained = (
        Metrics(1.0, r2, rmse, 9.0) for r2, rmse in zip((*choices["r2"], 0.95), choices["rmse"], strict=True)
    )
    free = Metrics(nan, nan, nan, nan) if lost else free
    coverage = choices["coverage"]
    changed = with_changes(
        entry,
        physics=make_physics(entry.physics, choices["bounded"], choices["constant"], choices["extremes"]),
        residual_structure=make_structure(choices["shares"], choices["percent"], lost),
        metrics={
            "estimation": entry.metrics["estimation"] | {"free_run": trained},
            "validation": entry.metrics["validation"] | {"free_run": free, "one_step_ahead": one},
        },
        outcomes={
            "estimation": entry.outcomes["estimation"],
            "validation": entry.outcomes["validation"] | {"free_run": LOST if lost else OK},
        },
        bands=None if coverage is None or lost else replace(entry.bands, coverage=coverage),
    )
    wide = replace(parts.validation, u=choices["widening"] * parts.validation.u)
    ensembles = {"none": None, "certain": base.ensemble, "doubtful": Ensemble(base.ensemble.structures[:0])}
    return replace(
        base,
        models=(changed,),
        split=Split(parts.estimation, wide),
        ensemble=ensembles[choices["ensemble"]],
    )


@given(CHOICES)
def test_no_two_sentences_of_a_result_contradict_each_other(choices):
    result = make_result(choices)
    document = result_document(result)
    document["data"]["noise"] = choices["noise"]
    assert not find_contradictions(" ".join(describe(document)))
    assert not find_contradictions(summary(document, result.recommended.model))


@given(CHOICES)
def test_the_sentences_of_the_report_do_not_contradict_each_other(choices):
    document = result_document(make_result(choices))
    page = identification_report(Origin("job"), document, "<math></math>", {}).decode()
    assert not find_contradictions(page)


@cache
def found_together():
    data = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    fitted = islands.fit(data, library="polynomial", degree=1, max_terms=4, certificate=0, average=1)
    return result_document(fitted.search_result)


#: Names of these outputs.
NAMES = ("y1", "y2")

#: Measured quantities of an output of several.
OUTPUTS = st.fixed_dictionaries(
    {
        "shares": st.tuples(SHARES, SHARES),
        "percent": st.sampled_from([1e-6, 0.5, 1.5]),
        "r2": st.tuples(*[st.sampled_from([-0.01, 0.3, 0.95])] * 2),
        "rmse": st.tuples(*[RMSES] * 3),
        "noise": st.sampled_from([None, 0.01, 0.1]),
        "coverage": st.sampled_from([None, 0.5, 0.9]),
    }
)


def change_output(output, choices, lost):
    """Return the entry of an output with chosen quantities."""
    residual = make_structure(choices["shares"], choices["percent"], lost)
    errors = [
        {"mape": 1.0, "r2": r2, "rmse": rmse, "fit_percent": 9.0}
        for r2, rmse in zip((*choices["r2"], 0.95), choices["rmse"], strict=True)
    ]
    free, one, trained = errors
    free = dict.fromkeys(free) if lost else free
    return {
        **output,
        "metrics": {
            "estimation": output["metrics"]["estimation"] | {"free_run": trained},
            "validation": {"free_run": free, "one_step_ahead": one},
        },
        "residual": finite(residual_structure_document(residual)),
        "bands": None if lost else output["bands"] | {"coverage": choices["coverage"]},
        "data": output["data"] | {"noise": choices["noise"]},
    }


@pytest.mark.ci
@given(st.tuples(OUTPUTS, OUTPUTS), st.booleans(), st.sampled_from([1.0, 3.0]))
def test_no_two_sentences_about_several_outputs_contradict_each_other(choices, lost, widening):
    base = found_together()
    outputs = [
        change_output(output, each, lost) for output, each in zip(base["outputs"], choices, strict=True)
    ]
    inputs = base["data"]["inputs"]
    (ranges,) = inputs["estimation"]
    wide = {**inputs, "validation": [[widening * each for each in ranges]]}
    document = {**base, "outputs": outputs, "data": {"inputs": wide}}
    sentences = describe(document)
    assert not find_contradictions(" ".join(sentences), NAMES)
    (verdict,) = (each for each in sentences if each.startswith("As a simulation"))
    # Of validation data that rest, the variance of the estimation data, of which 5 % are not explained.
    explained = [
        max(each["r2"][0], 1.0 - 0.05 * (each["rmse"][0] / each["rmse"][2]) ** 2) for each in choices
    ]
    follows = [
        r2 > 0.9
        or ((each["noise"] or 0.0) * 1.2 >= each["rmse"][0] and not (r2 < 0 and each["shares"][1] <= 0.1))
        for each, r2 in zip(choices, explained, strict=True)
    ]
    simulates = not lost and all(follows)
    assert verdict.startswith("As a simulation: unsuitable") != simulates
    page = identification_report(Origin("job"), document, "<math></math>", {})
    assert not find_contradictions(page.decode(), NAMES)


#: Measured quantities of a diagnosis, on both sides of every limit of its sentences.
DIAGNOSES = st.fixed_dictionaries(
    {
        "verdict": st.sampled_from(
            ["nothing", "named", "named with remainder", "family", "discovered", "unknown"]
        ),
        "confidence": st.lists(st.sampled_from([0.2, 0.4949, 0.4951, 0.9949, 1.0]), min_size=1, max_size=3),
        "claimed": st.booleans(),
        "families": st.sampled_from(["timing", "scale"]),
        "errors": st.tuples(*[st.sampled_from([1e-9, 0.0999, 0.12, 0.1201, 0.2999, 0.3001, 0.9, 3.0])] * 3),
        "low": st.sampled_from([-5.0, 0.0, 0.04, 30.0]),
        "floor": st.sampled_from([0.0, 0.1, 0.5]),
        "measured": st.booleans(),
        "remainder": st.sampled_from([{}, {"input": 4.6}]),
        "score": st.sampled_from([-3.0, 12.0]),
    }
)


def make_chosen_document(choices):
    """Return a document whose verdict, gain and remainder are possible together."""
    verdict, first = choices["verdict"], [True] + [choices["claimed"]] * 2
    has_causes = verdict not in ("nothing", "unknown")
    causes = [
        {**CAUSE, "confidence": each, "claimed": claimed, "family": choices["families"]}
        for each, claimed in zip(choices["confidence"], first, strict=False)
    ]
    if verdict in ("family", "discovered"):
        causes[0] |= {"free_form": True} if verdict == "family" else {"family": "discovered"}
    calibrated, before, after = choices["errors"]
    reduction = 100.0 * (1.0 - after / before)
    low = min(choices["low"], reduction)
    gain = {
        **GAIN,
        "before": {"rmse": before, "mape": 1.0},
        "after": {"rmse": after, "mape": 1.0},
        "reduction_percent": reduction,
        "ci95": [low, max(reduction, 40.0)],
    }
    return make_document(
        verdict,
        effects=causes if has_causes else [],
        gain=gain if has_causes else None,
        calibrated_rmse=calibrated,
        as_given_rmse=before,
        noise_floor_rmse=choices["floor"],
        noise_floor_is="measured by repeated periods" if choices["measured"] else "an upper bound",
        remainder={} if verdict in ("nothing", "named") else choices["remainder"],
        candidates=[{"name": "jump", "score": choices["score"], "eta": 1.0}],
    )


@pytest.mark.parametrize("ratio", [2.999, 3.0])
def test_an_error_that_is_written_as_far_from_the_noise_is_not_explained(ratio):
    gain = GAIN | {"after": {"rmse": 0.1 * ratio, "mape": 1.0}}
    text = " ".join(
        describe_diagnosis(make_document("named", effects=[CAUSE], gain=gain, noise_floor_rmse=0.1))
    )
    assert "3 times the floor" in text
    assert not find_contradictions(text)


@given(DIAGNOSES)
def test_no_two_sentences_about_a_diagnosis_contradict_each_other(choices):
    document = make_chosen_document(choices)
    assert not find_contradictions(" ".join(describe_diagnosis(document)))
    assert len(write("diagnosis", "verdict", f=DiagnosisFacts(document))) == 1


CASES = make_cases()

PORTFOLIO = [name for name in CASES if name.startswith("portfolio")]

#: Cases of every kind; `lab/searches/contradictions.py` has all of them.
SAMPLE = (
    *PORTFOLIO[::12],
    *[name for name in CASES if name.startswith("law")][::24],
    *(name for name in CASES if name.startswith("first order") and name.endswith("seed 1")),
    "first order, extrapolation, seed 0",
    *[name for name in CASES if name.startswith("several outputs")][::10],
    *("diagnosis, portfolio, first order", "diagnosis, column, gain, seed 0"),
)


#: Further cases, each with some seconds of search.
SLOW = (
    *(name for name in PORTFOLIO if name not in SAMPLE),
    *(f"first order, {fault}, seed 0" for fault in ("spikes", "short", "integrator", "sentinels")),
    *("diagnosis, portfolio, tank", "diagnosis, wrong parameter", "diagnosis, channels"),
    "diagnosis, stopped before free forms",
)


@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.ci) for name in SAMPLE),
        *(pytest.param(name, marks=pytest.mark.nightly) for name in SLOW),
    ],
)
def test_no_two_sentences_about_a_record_contradict_each_other(name):
    """In the summary, in a notebook, over REST and in the report, from the run and from its folder."""
    result = CASES[name]()
    outputs = result.output_names if isinstance(result, islands.Result) else ()
    for where, text in list_texts(name, result).items():
        assert not find_contradictions(text, outputs if outputs[1:] else ()), where
