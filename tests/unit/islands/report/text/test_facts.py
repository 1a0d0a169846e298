"""Facts about results: each statement follows from the quantities of a document, and is complete."""

from copy import deepcopy
from functools import cache

import pytest

import islands
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.text.facts import DryFriction, ResultFacts, find_dry_friction
from islands.report.text.statements import describe
from islands.sentences import write
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.searches import record
from support.statements import EMPTY, check_template, find_contradictions

METRICS = "models.0.metrics.validation"
RESIDUAL = "models.0.residual_tests"
LOST = {
    f"{METRICS}.free_run": dict.fromkeys(("mape", "r2", "rmse", "fit_percent")),
    f"{RESIDUAL}.verdict": "inadequate",
}
STRUCTURE = {
    f"{RESIDUAL}.verdict": "inadequate",
    f"{RESIDUAL}.predictable_percent": 5.0,
    f"{RESIDUAL}.predictable_share": {"one_step_ahead": 0.02, "free_run": 0.94},
}
AHEAD = STRUCTURE | {f"{RESIDUAL}.predictable_share": {"one_step_ahead": 0.5, "free_run": 0.94}}
WHITE = {f"{RESIDUAL}.predictable_share": {"one_step_ahead": 0.02, "free_run": 0.02}}
TERM = {"parameter": -0.9, "standard_error": 0.001, "inclusion": 1.0}
LAW = {
    "units": (1,),
    "law": "saturation",
    "over": "u_V",
    "unit": "V",
    "places": (-1.0, 1.5),
    "has_line": True,
    "deviation_percent": 0.4,
}
CHECK = {"text": "[u(k-1)] >= 0", "named": "[u_V(k-1)] >= 0", "target": 0.0, "value": -0.5}


def worst(name, excess=3.0):
    """Return residual tests of which one exceeds its limit by most."""
    names = ("xi_xi", "u_xi", "xi_xiu", "u2_xi", "u2_xi2")
    tests = [
        {
            "name": each,
            "input": None if each == "xi_xi" else 0,
            "limit": 1.0,
            "largest": excess * (each == name),
        }
        for each in names
    ]
    return AHEAD | {f"{RESIDUAL}.tests": tests}


#: Changes of a result of which each statement follows.
RESULTS = {
    "essence_verdict": [{}, LOST],
    "essence_output_error": [
        *({}, LOST, {f"{METRICS}.free_run.rmse": 1e-12}, {"linear": None}),
        *({"data.noise": 1.0}, {"data.noise": None} | WHITE),
    ],
    "essence_physics": [{}, {"models.0.laws": [LAW, LAW | {"units": (2, 3), "has_line": False}]}]
    + [
        {
            "record.units.output": "rad/s",
            "models.0.terms": [TERM | {"regressor": each, "term": each} for each in terms],
        }
        for terms in (["u(k-1)", "sign(y(k-1))"], ["sign(y(k-1))"])
    ],
    "essence_limits": [{}, STRUCTURE],
    "essence_next": [{}],
    "choice": [
        *({}, {"recommended.reasons": []}),
    ],
    "units": [
        {"preprocessing.feedthrough": ["u_V"], "record.reading": ["sorted by time", "2 rows left out"]},
        {"preprocessing.average": 2, "models.0.named_signals": "y_um and u_V as deviations"},
    ],
    "finding_criterion": [
        {
            "models.0.criterion": {"estimator": each, "interval": 500, "error": "free_run"},
            "models.0.constraints": [],
        }
        for each in islands.ESTIMATORS
    ],
    "finding_refit": [
        {"models.0.refit": {"samples": 400, "discarded": each}} for each in ("", "the free run diverges")
    ],
    "finding_output_accuracy": [{}, LOST, {f"{METRICS}.free_run.r2": None, f"{METRICS}.free_run.mape": None}],
    "finding_recordings": [{"models.0.recordings.validation": {"one": {"rmse": 0.1}, "two": {"rmse": None}}}],
    "finding_missing_outputs": [{"data.missing_outputs": 7}],
    "finding_output_left_out": [{"data.left_out": {"samples": 3, "rmse": 0.1, "rmse_with": 2.0}}],
    "finding_output_uncertainty": [
        {},
        {"models.0.kind": "latent"},
        {"models.0.terms.0.inclusion": 0.8999, "models.0.terms.1.inclusion": 0.3},
    ],
    "finding_met_constraints": [{"models.0.constraints": [CHECK | {"met": True}, CHECK | {"met": True}]}],
    "finding_preset": [{"settings.choice": {"reasons": ["A loop is closed.", "Preset hysteresis."]}}],
    "linear_part": [{}],
    "finding_output_details": [{}],
    "finding_uses": [{}, LOST],
    "finding_not_computed": [{"not_computed": [{"step": "bands", "reason": "the disk is full"}]}],
    "headline": [
        *({}, LOST, {f"{METRICS}.free_run.mape": None}, {"models.0.kind": "latent", "models.0.size": 1}),
        {"models.0.refit": {"samples": 400, "discarded": ""}},
    ],
    "detail_predictable_share": [{}],
    "detail_coverage": [{}],
    "detail_few_errors": [{"models.0.bands.independent_samples": each} for each in (2.0, 7.2)],
    "detail_one_step_share": [{}],
    "use_simulation": [{}, LOST],
    "use_output_adequate_residual": [{}],
    "use_output_rounding_residual": [{f"{RESIDUAL}.predictable_share.free_run": 0.5}],
    "limit_unsound": [
        {"models.0.physics.property_1": False, "recommended.reasons": ["a", "no model passes"]}
    ],
    "limit_unmet_constraints": [
        {"models.0.constraints": [CHECK | {"met": False}, CHECK | {"met": False, "value": None}]}
    ],
    "limit_output_no_simulation": [LOST],
    "limit_output_unrelated": [{"models.0.reads_inputs": False}],
    "limit_output_at_rest": [{f"{METRICS}.free_run.r2": -0.01}],
    "limit_output_poor_simulation": [{f"{METRICS}.free_run.r2": 0.3, f"{METRICS}.free_run.rmse": 1.0}],
    "limit_diverging_excursions": [{"models.0.physics.excursions.0.bounded": False}],
    "limit_missing_checks": [{"models.0.physics.not_computed": "why", f"{RESIDUAL}.not_computed": "why"}],
    "limit_diverging_holds": [{"models.0.physics.holds.0.bounded": False}],
    "limit_implausible_extremes": [
        {
            "models.0.physics.extremes.0": {"level": -1.2, "plausible": False} | each,
            "recommended.reasons": ["a"],
        }
        for each in (
            {"bounded": False, "ranges": None},
            {"bounded": True, "ranges": 1940.0},
            {"bounded": True, "ranges": None},
        )
    ],
    "limit_drift": [{"models.0.physics.property_1": False, "models.0.physics.hold_drift_percent": 7.5}],
    "limit_open_loops": [{"models.0.physics.excursions.0.closure_percent": 6.0}],
    "limit_output_predictable_residual": [STRUCTURE],
    "limit_output_unexplained_error": [WHITE | {"data.noise": 1e-4}],
    "limit_output_low_coverage": [{"models.0.bands.coverage": 0.5}],
    "limit_output_wide_band": [{"models.0.bands.width": 100.0}],
    "limit_output_error_ratio": [{"models.0.metrics.estimation.free_run.rmse": 1e-4}],
    "limit_output_estimation_error": [
        {"models.0.metrics.estimation.free_run.rmse": each} for each in (1.0, None)
    ],
    "limit_extrapolation": [{"data.inputs.validation": [[-5.0, 5.0]]}],
    "next_more_terms": [STRUCTURE],
    "next_output_terms_of_another_form": [
        STRUCTURE | {"data.noise": 1e-4},
        STRUCTURE | {"data.noise": 1e-4, "models.0.kind": "latent"},
    ],
    "next_output_free_run_estimate": [STRUCTURE, STRUCTURE | {"settings.estimator": "", "data.noise": 1e-4}],
    "next_output_other_terms": [
        *(worst(name) for name in ("xi_xi", "u_xi", "xi_xiu", "u2_xi", "u2_xi2")),
        AHEAD | {"models.0.kind": "latent", "settings.structure": "wiener"},
    ],
    "next_output_noise": [
        {f"{METRICS}.one_step_ahead.rmse": 0.1, "models.0.metrics.estimation.one_step_ahead.rmse": 0.1}
        | WHITE
    ],
    "next_wider_record": [{"data.inputs.validation": [[-5.0, 5.0]]}],
    "next_sensor_limits": [{"data.output_limits": [None, 2.0]}],
    "next_insignificant": [
        {"models.0.terms.0.standard_error": 9.0},
        {"models.0.terms.0.standard_error": 9.0, "settings.select": "fitness", "recommended.reasons": []},
    ],
    "next_unlikely": [{"models.0.terms.1.inclusion": 0.3}],
    "next_check": [{}, WHITE | {f"{METRICS}.free_run.r2": -0.01, "data.noise": None}],
    "other_class": [{}, {"settings.structure": "wiener"}],
}

DIVERGED = {
    "metrics.validation.free_run": LOST[f"{METRICS}.free_run"],
    "bands": None,
    "residual.verdict": "inadequate",
}

#: Changes of the second of two outputs, with a statement about it alone that follows.
COUPLED = {
    "y2, error: the free run on the validation data diverges.": DIVERGED,
    "y2: simulation from the inputs alone: the free run diverges": DIVERGED,
    "y2: simulation from the inputs alone: R2 0.300": {
        "metrics.validation.free_run.r2": 0.3,
        "metrics.estimation.free_run.r2": 0.3,
        "data.noise": None,
    },
    "y2: 94 % of the free-run residual is predictable (RMS 5 % of the output range)": {
        "residual.verdict": "inadequate",
        "residual.predictable_percent": 5.0,
        "residual.predictable_share.free_run": 0.94,
    },
    "y2: the 90 % prediction band contains 50 % of the validation samples": {"bands.coverage": 0.5},
    "y2: the 90 % prediction band is wider than the output range": {"bands.width": 100.0},
    "y2: the free-run error on the validation data is": {"metrics.estimation.free_run.rmse": 1e-4},
    "y2: the free-run error on the estimation data is": {"metrics.estimation.free_run.rmse": 10.0},
    "y2, gross errors: over the whole record": {
        "data.left_out": {"samples": 3, "rmse": 0.1, "rmse_with": 2.0}
    },
    "y2: try other terms or more lags in its equation": {"residual.verdict": "inadequate"},
    "Fails at: extrapolation: u": {"data.inputs.validation": [[-3.0, 3.0]]},
    "Next: estimate from a record": {"data.inputs.validation": [[-3.0, 3.0]]},
}


@cache
def result():
    data = record(300)
    named = Dataset(data.u, data.y, 0.1, ("u_V",), "y_um", ("V",), "um")
    settings = {"library": "phi-polynomial", "max_terms": 4, "estimator": "least-squares", "seed": 7}
    document = result_document(islands.fit(named, **settings).search_result)
    best = document["models"][document["recommended"]["rank"] - 1]
    document["models"], document["recommended"]["rank"] = [best], 1
    for test in best["physics"]["excursions"]:
        test["closure_percent"] = 0.0
    for part in best["metrics"].values():
        part["one_step_ahead"] = dict(part["free_run"])
    return document


@cache
def coupled_result():
    data = make_coupled_record(TWO_MASSES, samples=400, noise=0.01)
    fitted = islands.fit(data, library="polynomial", degree=1, max_terms=4, certificate=0, average=1)
    return result_document(fitted.search_result)


def change(document, changes, outputs=()):
    """Return a document with other values at dotted paths; those of `outputs` are of the second output."""
    changed = deepcopy(document)
    for path, value in changes.items():
        *folders, name = path.split(".")
        is_of_output = path.split(".")[0] in outputs and not path.startswith("data.inputs")
        place = changed["outputs"][1] if is_of_output else changed
        for folder in folders:
            place = place[int(folder) if folder.isdigit() else folder]
        place[int(name) if name.isdigit() else name] = deepcopy(value)
    return changed


def list_facts(cases, make):
    """Return the facts of each case of a template."""
    return {name: [make(changes) for changes in variants] for name, variants in cases.items()}


def make_result_facts(changes):
    return {"f": ResultFacts(change(result(), changes)), "point": "u_V = 1 V", "parts": ["a gain of 2 um/V"]}


def test_each_statement_is_written_where_it_holds_and_contradicts_no_other_one():
    made = list_facts(RESULTS, make_result_facts)
    check_template("result", made)
    for facts in (each["f"] for variants in made.values() for each in variants):
        assert not find_contradictions(" ".join(describe(facts.document)))


@pytest.mark.ci
@pytest.mark.parametrize("statement", COUPLED)
def test_a_statement_about_one_of_several_outputs_names_it(statement):
    parts = ("metrics", "residual", "bands", "data")
    text = " ".join(describe(change(coupled_result(), COUPLED[statement], parts)))
    assert statement in text
    assert not find_contradictions(text, ("y1", "y2"))
    assert not EMPTY.search(text)


@pytest.mark.ci
def test_a_statement_that_holds_of_all_outputs_stands_once():
    text = " ".join(describe(coupled_result()))
    assert text.count("no structure is left in the free-run residual") == 1
    assert text.count("error: RMSE") == 2


def test_a_result_without_changes_fails_no_check():
    """Each limit above follows from its change."""
    facts = ResultFacts(result())
    assert not facts.limits
    assert len(write("result", "next", f=facts)) == 1


@pytest.mark.parametrize(
    ("samples", "ratio"), [(7.2, 1.8), (3.0, 3.0), (2.0, 5.0), (16.0, 1.4), (18.0, None), (None, None)]
)
def test_an_error_that_few_independent_samples_measure_is_uncertain(samples, ratio):
    """The ratios are those of the quantile of 5 % of the chi-square distribution, at most 5."""
    facts = ResultFacts(change(result(), {"models.0.bands.independent_samples": samples}))
    assert facts.is_uncertain == (ratio is not None)
    assert ratio is None or round(facts.stated_ratio, 1) == ratio


@pytest.mark.parametrize(
    ("r2", "rmse", "noise", "simulates"),
    [
        (0.9, 1.0, None, True),
        (0.89, 1.0, None, False),
        (0.3, 1.2, 1.0, True),
        (0.3, 1.21, 1.0, False),
        (None, 1.0, None, True),
    ],
)
def test_a_free_run_follows_the_output_by_r2_or_to_its_noise(r2, rmse, noise, simulates):
    changes = {
        f"{METRICS}.free_run": {"r2": r2, "rmse": rmse, "mape": 1.0},
        "data.noise": noise,
        f"{RESIDUAL}.verdict": "minor",
    }
    assert ResultFacts(change(result(), changes)).simulates == simulates


def test_the_ratio_of_two_rounding_errors_is_not_a_failure():
    changes = {"models.0.metrics.estimation.free_run.rmse": 1e-16, f"{METRICS}.free_run.rmse": 3e-16}
    facts = ResultFacts(change(result(), changes))
    assert not any((facts.generalises_poorly, facts.fits_poorly, facts.noise_ratio, facts.linear_ratio))


def test_noise_of_the_output_biases_least_squares_alone():
    noisy = {
        f"{METRICS}.one_step_ahead.rmse": 0.1,
        "models.0.metrics.estimation.one_step_ahead.rmse": 0.1,
    } | WHITE
    assert ResultFacts(change(result(), noisy)).has_output_noise
    assert not ResultFacts(
        change(result(), noisy | {"models.0.criterion.estimator": "free-run"})
    ).has_output_noise
    assert not ResultFacts(change(result(), noisy | {"settings.estimator": ""})).has_output_noise
    assert not ResultFacts(change(result(), WHITE)).has_output_noise


MOTOR = (("y(k-1)", 0.95), ("u(k-1)", 0.8), ("sign(y(k-1))", -0.9))


def make_terms(*terms, error=0.001):
    return [{"regressor": text, "parameter": value, "standard_error": error} for text, value in terms]


def test_friction_is_the_opposing_step_and_the_input_that_balances_it():
    assert find_dry_friction(make_terms(*MOTOR), "rad/s") == DryFriction(0.9, pytest.approx(1.125))


def test_lags_of_one_direction_add_up():
    driving, opposing = (("u(k-1)", 0.5), ("u(k-2)", 0.3)), (("sign(y(k-1))", -0.7), ("sign(y(k-2))", -0.2))
    split = make_terms(MOTOR[0], *driving, *opposing)
    assert find_dry_friction(split, "m/s") == pytest.approx(DryFriction(0.9, 1.125))


@pytest.mark.parametrize("unit", ["rpm", "m/s", "deg/s", "1/min"])
def test_the_output_is_a_velocity(unit):
    assert find_dry_friction(make_terms(*MOTOR), unit)


@pytest.mark.parametrize("unit", ["", "um", "m/s^2", "l/min", "kg/s", "s"])
def test_a_sign_of_another_quantity_is_no_friction(unit):
    assert find_dry_friction(make_terms(*MOTOR), unit) is None


@pytest.mark.parametrize(
    "terms",
    [
        make_terms(*MOTOR[:2]),
        make_terms(*MOTOR[:2], ("sign(y(k-1))", 0.9)),
        make_terms(*MOTOR[:2], ("u(k-1)*sign(y(k-1))", -0.9)),
        make_terms(*MOTOR[:2], ("sign(y(k-1) - y(k-2))", -0.9)),
        make_terms(*MOTOR, error=0.5),
    ],
    ids=["none", "driving", "product", "acceleration", "uncertain"],
)
def test_terms_that_do_not_oppose_the_motion_are_no_friction(terms):
    assert find_dry_friction(terms, "rad/s") is None


@pytest.mark.parametrize("other", [("u(k-1)^2", 0.1), ("y(k-1)*u(k-1)", 0.1)])
def test_an_input_that_acts_nonlinearly_has_no_balance(other):
    assert find_dry_friction(make_terms(*MOTOR, other), "rad/s") == DryFriction(0.9, None)


def test_several_inputs_have_no_balance():
    terms = make_terms(MOTOR[0], ("u1(k-1)", 0.8), ("u2(k-1)", 0.1), MOTOR[2], error=None)
    assert find_dry_friction(terms, "rad/s") == DryFriction(0.9, None)
