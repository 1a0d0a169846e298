"""Facts about a diagnosis: each statement follows from the numbers of its document, and is complete."""

from itertools import product

import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.report.text.diagnosis_facts import DiagnosisFacts, write_value
from islands.report.text.statements import describe_diagnosis, describe_headline
from islands.sentences import write
from support.diagnosis_documents import CAUSE, GAIN, make_document
from support.statements import check_template, find_contradictions


def _value(value, unit):
    return {"value": value, "unit": unit, "ci95": None}


EXTENSION = {
    "equations": ["dx/dt = u(t - tau) - k*x", "output = x"],
    "values": [{"name": "tau", "effect": "delay", "value": 0.03, "unit": "s", "ci95": [0.02, 0.04]}],
    "notes": ["u is force_N"],
    "ranges": [{"name": "force_N", "unit": "N", "low": -10.0, "high": 4.0, "rate": 3.0}],
    "refusal": "The extension is not saved.",
    "contradictions": ["Offset: an empty tank loses 1 V/s.", "Another one."],
}
TERM = CAUSE | {"name": "missing-term", "family": "discovered", "term": "a1*u in output", "error_share": 0.98}
EXPLAINED = CAUSE | {
    "error_share": 0.9876,
    "summary": "Dry friction: - F sign(x')",
    "distinguished_by": "a phase that grows with the frequency",
    "occurs_in": "sampling and communication",
    "equivalents": ["sensor-lag", "own-effect"],
}
NOISE = CAUSE | {
    "name": "coloured-noise",
    "eta": None,
    "parameters": {"pole": _value(0.83, ""), "order": _value(7.0, ""), "difference order": _value(0.3, "")},
}
SWEEP = {"frequency": _value(0.5, "Hz"), "rate": _value(1.5, "Hz/s")}
LAW = {"law": "absolute value", "formula": "y + 0.98 |y|", "parameter": "a", "value": 0.98, "unit": ""}
RECORD = make_document("named")["record"] | {
    "samples": 1000,
    "start": 0.0,
    "segments": [100, 50, 50],
    "recordings": ["a.csv", "b.csv", "c.csv"],
    "reading": ["sorted by time", "2 rows left out"],
}
CHANNELS = RECORD | {
    "names": {"inputs": ["force_N", "load_N"], "output": "travel_um"},
    "units": {"inputs": ["N", "N"], "output": "um"},
}
WORSE = GAIN | {"after": {"rmse": 0.202, "mape": 1.0}, "reduction_percent": -1.0, "ci95": [-3.0, 1.0]}
FINDING = {"name": "sign", "description": "The sign is flipped.", "advice": "Multiply by -1.", "errors": None}
CORRECTED = FINDING | {"errors": {"before": 0.3, "after": 0.01}}
VALUE = {"name": "delay tau", "unit": "s", "estimation": 0.03, "validation": 0.031, "agrees": True}
JUMP = VALUE | {"name": "jump", "agrees": False}
CLAIM = {"rms": 0.0123, "correlation_time": 0.0, "noise_level": 0.01}
TESTED = {
    "false_alarm_rate": {"value": 0.0, "ci95": [0.0, 0.088], "of": 40},
    "p_value": 1 / 41,
    "detection_limits": {"delay": {"strength": 0.1, "unit": "s", "misfit_sigma": 0.2}, "jump": None},
    "tested_misfits": [0.05, 6.4],
}
NEAREST = [{"name": "delay", "score": 3.0, "eta": 1.0}]


def other(**changes):
    return CAUSE | {"name": "jump"} | changes


def named(*causes, verdict="named", **changes):
    return make_document(verdict, effects=[*(causes or [CAUSE])], **({"gain": GAIN} | changes))


#: Documents from which each statement follows.
CASES = {
    "verdict_nothing": [
        make_document("nothing", effects=effects, noise_claim=claim)
        for effects, claim in (([], None), ([NOISE], None), ([], CLAIM))
    ],
    "verdict_noise": [make_document("noise")],
    "verdict_nothing_in_estimation_data": [make_document("nothing", calibrated_rmse=0.4)],
    "verdict_named": [
        named(),
        named(CAUSE | {"confidence": 0.6}, other(claimed=False), verdict="named with remainder"),
        named(CAUSE, other(free_form=True)),
        named(CAUSE | {"name": "sensor-gain", "family": "scale"}),
        named(CAUSE | {"name": "core-shape"}),
    ],
    "verdict_uncertain": [
        named(CAUSE | {"confidence": 0.36}),
        named(CAUSE | {"confidence": 0.36, "free_form": True}, verdict="family"),
        named(CAUSE | {"confidence": 0.36}, other()),
    ],
    "verdict_family": [named(CAUSE | {"free_form": True}, verdict="family")],
    "verdict_discovered": [named(TERM, verdict="discovered"), named(TERM, CAUSE, verdict="discovered")],
    "verdict_unknown": [make_document("unknown")],
    "verdict_stopped": [make_document("stopped")],
    "verdict_gross_error": [make_document("gross error", record_findings=[FINDING])],
    "cause": [
        named(),
        named(EXPLAINED, TERM, other(claimed=False, confidence=1.0)),
        *(named(EXPLAINED | {"error_share": share}) for share in (0.06, 1.5, -0.5)),
        named(CAUSE | {"confidence": 0.001, "resembles": LAW}),
        make_document("gross error", effects=[CAUSE | {"family": "gross"}], record_findings=[CORRECTED]),
    ],
    "detail_intervals": [named()],
    "detail_comparisons": [named(EXPLAINED, other(error_share=0.5))],
    "detail_coordinate": [named(EXPLAINED, simulation=each) for each in ("second-order", "linear:2")],
    "detail_small_delay": [named(CAUSE | {"parameters": {"tau": _value(0.014, "s")}})],
    "detail_input_limits": [
        named(
            other(name="input-saturation", parameters={"cut": _value(0.3, "")}),
            other(name="rate-limit", parameters={"inverse_rate": _value(0.25, "s/N")}),
            extension=EXTENSION,
        )
    ],
    "detail_second_input": [named(other(name="second-input"), record=CHANNELS)],
    "detail_sweeps": [
        named(*(other(name=f"swept-{each}", parameters=SWEEP) for each in names), record=RECORD)
        for names in (["disturbance", "interference"], ["interference"])
    ],
    "detail_noise": [named(CAUSE, NOISE), named(NOISE, NOISE)],
    "detail_correlation": [named(CAUSE, NOISE)],
    "detail_recordings": [named(record=RECORD, estimation_samples=100)],
    "detail_record": [make_document("gross error", record_findings=[CORRECTED, FINDING])],
    "detail_reading": [named(record=RECORD)],
    "detail_correction": [make_document("gross error", record_findings=[FINDING])],
    "detail_without_terms": [named(TERM, verdict="discovered")],
    "detail_equations": [
        named(TERM, verdict="discovered"),
        named(discovered={"equations": "output = u", "effects": ["jump"], "nearest": [], "worse_by": -1.0}),
    ],
    "detail_extended_simulation": [
        named(extension=EXTENSION, calibrated={"k": 2.0, "initial x": 0.3}),
        named(CAUSE, other(), equations="dx/dt = u - k*x", calibrated={"k": 2.0}),
    ],
    "detail_calibrated": [
        make_document("nothing", calibrated={"k": 2.0}),
        named(TERM, verdict="discovered", calibrated={"k": 2.0, "tau": 4.0}),
    ],
    "detail_nearest_to_terms": [named(TERM, verdict="discovered")],
    "detail_nearest": [
        make_document("unknown", candidates=NEAREST * 2),
        make_document("unknown", candidates=[NEAREST[0] | {"score": -1.0}]),
    ],
    "detail_remainder": [make_document("unknown", remainder={"output": 5.3, "input": 4.6})],
    "detail_predictable_residual": [make_document("unknown")],
    "detail_gain": [named(), named(gain=WORSE), named(output_std=None)],
    "detail_exchange": [
        named(exchange={"gain": gain, "values": values})
        for gain in (None, GAIN, WORSE)
        for values in ([], [VALUE, VALUE], [VALUE | {"agrees": False}] * 2)
    ]
    + [named(other(depends_on_time=True), exchange={"gain": GAIN, "values": [JUMP]})],
    "detail_calibration": [named(calibrated={"k": 2.0}, as_given_rmse=0.1)],
    "detail_time_dependent": [
        named(other(depends_on_time=True), is_time_left_out=each) for each in (False, True)
    ],
    "detail_one_record": [named()],
    "detail_error": [make_document("unknown"), make_document("unknown", calibrated_rmse=0.2)],
    "detail_growth": [make_document("noise", calibrated_rmse=0.0186, noise_floor_rmse=0.0123)],
    "detail_refusal": [named(extension=EXTENSION)],
    "detail_contradictions": [named(extension=EXTENSION)],
    "detail_noise_floor": [
        make_document("unknown", calibrated_rmse=each, noise_floor_is=is_measured)
        for each in (0.001, 0.01, 0.4, 1e-9)
        for is_measured in ("an upper bound", "measured by repeated periods")
    ],
    "detail_stated_noise": [named(noise_claim=CLAIM)],
    "detail_noise_record": [make_document("noise")],
    "detail_large_noise": [
        make_document("nothing", effects=each, calibrated_rmse=0.5, noise_floor_rmse=0.5)
        for each in ([], [NOISE])
    ],
    "detail_experiment": [named(decisive_experiment="a step of force_N")],
    "detail_separated": [
        named(next_experiment={"pairs": [{"causes": ["delay", "jump"], "recorded": {"is_sufficient": True}}]})
    ],
    "detail_gross_errors": [named(data={"left_out": {"samples": 3, "rmse": 0.1, "rmse_with": 2.0}})],
    "detail_formula": [make_document("unknown", proposal={"explains": 0.73, "formula": "0.2*u^2"})],
    "detail_left_out": [make_document("stopped", left_out=["free forms", "planning"])],
    "detail_not_computed": [named(not_computed=[{"step": "figures", "reason": "the disk is full"}])],
    "detail_false_alarms": [make_document("nothing", **TESTED)],
    "detail_detection_limits": [make_document("nothing", **TESTED)],
    "reference": [named(), named(calibrated={})],
    "extended_values": [named(TERM, extension=EXTENSION, calibrated={"k": 2.0})],
    "extended_notes": [named(extension=EXTENSION)],
    "headline": [
        named(),
        make_document("unknown"),
        make_document("gross error", record_findings=[CORRECTED]),
    ],
}


def test_each_statement_is_written_where_it_holds_and_contradicts_no_other_one():
    made = {
        name: [
            {"f": facts, "cause": cause}
            for facts in map(DiagnosisFacts, documents)
            for cause in facts.causes or [None]
        ]
        for name, documents in CASES.items()
    }
    check_template("diagnosis", made)
    for document in (each for documents in CASES.values() for each in documents):
        assert not find_contradictions(" ".join(describe_diagnosis(document)))


@pytest.mark.parametrize("verdict", Verdict)
@pytest.mark.parametrize(("confidence", "error"), list(product((0.3, 0.9), (0.01, 0.4))))
def test_one_statement_gives_the_verdict_and_the_headline_is_a_part_of_the_sentences(
    verdict, confidence, error
):
    causes = (
        [] if verdict in ("nothing", "noise", "unknown", "stopped") else [CAUSE | {"confidence": confidence}]
    )
    document = make_document(str(verdict), effects=causes, calibrated_rmse=error, record_findings=[FINDING])
    assert len(write("diagnosis", "verdict", f=DiagnosisFacts(document))) == 1
    assert set(describe_headline(document)) <= {line.strip() for line in describe_diagnosis(document)}


@pytest.mark.parametrize(
    ("after", "low", "extent"),
    [(0.012, 95.0, "all"), (0.1, 40.0, "most"), (0.19, 2.0, "part"), (0.19, -1.0, "nothing")],
)
def test_the_extent_is_that_of_the_held_out_data(after, low, extent):
    """A gain whose interval includes zero is none."""
    gain = GAIN | {"after": {"rmse": after, "mape": 1.0}, "ci95": [low, 99.0]}
    assert DiagnosisFacts(named(gain=gain)).extent == extent


def test_a_cause_has_its_plain_name_its_name_and_its_place():
    titles = {"delay": "delay of the input", "input-offset:upper": "offset of the input at upper"}
    facts = DiagnosisFacts(named(titles=titles))
    assert facts.label("delay", "a1*u in output") == "delay of the input a1*u in output (`delay`)"
    assert facts.label("input-offset", place="upper") == "offset of the input at upper (`input-offset`)"
    assert facts.label("state-clip", place="lower") == "state-clip of lower"


@pytest.mark.parametrize(("delay", "stated"), [(-0.0002, True), (0.014, True), (0.03, False)])
def test_a_delay_of_a_sample_may_be_that_of_the_recording(delay, stated):
    facts = DiagnosisFacts(named(CAUSE | {"parameters": {"tau": _value(delay, "s")}}))
    assert bool(facts.small_delay) == stated


def test_limits_of_the_input_have_its_unit():
    (saturation,) = CASES["detail_input_limits"]
    assert DiagnosisFacts(saturation).input_limits == [
        ("input-saturation", pytest.approx(7.0), "N"),
        ("rate-limit", pytest.approx(4.0), "N/s"),
    ]
    assert len(DiagnosisFacts(saturation | {"extension": {}}).input_limits) == 1


@pytest.mark.parametrize(("error", "grows"), [(0.0184, False), (0.0186, True)])
def test_an_error_that_grows_is_no_noise_of_constant_size(error, grows):
    document = make_document("noise", calibrated_rmse=error, noise_floor_rmse=0.0123)
    assert DiagnosisFacts(document).grows == grows


def test_the_stated_noise_is_compared_with_the_error_once():
    assert DiagnosisFacts(named(noise_claim=CLAIM)).is_noise_compared
    finding = FINDING | {"name": "above-noise-level"}
    for other_comparison in (
        make_document("nothing", noise_claim=CLAIM),
        make_document("unknown", noise_claim=CLAIM, record_findings=[finding]),
        named(),
    ):
        assert not DiagnosisFacts(other_comparison).is_noise_compared


def test_large_noise_may_hide_a_discrepancy():
    for error, large in ((0.5, True), (0.01, False)):
        changes = {"calibrated_rmse": error, "noise_floor_rmse": error}
        assert DiagnosisFacts(make_document("nothing", **changes)).has_large_noise == large
    assert not DiagnosisFacts(make_document("nothing", calibrated_rmse=0.5)).has_large_noise


@pytest.mark.parametrize(("after", "removes"), [(0.01, True), (0.3, False)])
def test_a_correction_that_a_calibration_hides_removes_no_error(after, removes):
    finding = FINDING | {"errors": {"before": 0.3, "after": after}}
    assert DiagnosisFacts(make_document("gross error", record_findings=[finding])).removes_error == removes


@pytest.mark.parametrize(("better", "is_least"), [(0, True), (1, False), (40, False)])
def test_p_value_is_bounded_by_the_number_of_records(better, is_least):
    document = make_document("nothing", **TESTED | {"p_value": (1 + better) / 41})
    assert DiagnosisFacts(document).is_least_p_value == is_least


@pytest.mark.parametrize(
    ("value", "unit", "interval", "written"),
    [
        (0.123456, "V", (0.1, 0.15), "0.1235 V (0.1 to 0.15)"),
        (2.0, "1/mm", (1.99998, 2.00001), "2 1/mm (1.99998 to 2.00001)"),
        (-51234.5, "", (-51234.7, -51234.3), "-51234.5 (-51234.7 to -51234.3)"),
        (-11.967228, "", (-11.967228 - 1e-12, -11.967228 + 1e-12), "-11.97 (not determined by the record)"),
        (0.0, "V", (0.0, 0.0), "0 V (0 to 0)"),
        (0.25, "1", None, "0.25"),
    ],
)
def test_a_value_has_the_digits_that_its_interval_needs(value, unit, interval, written):
    assert write_value({"value": value, "unit": unit, "ci95": interval}) == written


def test_an_interval_of_exact_data_is_written_as_its_half_width():
    assert (
        write_value({"value": 2.0, "unit": "s", "ci95": [2.0 - 1e-12, 2.0 + 1e-12]}, True)
        == "2 s (+/- 1e-12)"
    )


def test_contradictions_are_found():
    said = " ".join(describe_diagnosis(make_document("nothing")))
    assert not find_contradictions(said)
    assert find_contradictions(f"{said} The simulation lacks known effects, which explain the discrepancy.")
    assert find_contradictions(f"{said} The remaining residual depends on: input.")
    assert find_contradictions(
        "the RMSE falls from 2 (as given) to 1, by 50.0 % (-2.0 to 70.0 with 95 % confidence)"
    )
    assert find_contradictions(
        "The simulation lacks a known effect, confidence 0.31, 99 % of the misfit above the noise floor"
    )
    assert find_contradictions(
        "The simulation lacks a known effect, confidence 0.31; without it, the RMSE is 10 times as large"
    )
    floor = "The noise floor, the RMSE of the noise alone, is"
    assert find_contradictions(f"{floor} 0.2 um, noise floor (upper bound) 0.3")
