"""Statements about a diagnosis: each follows from the numbers of its document."""

import re
from importlib.resources import files
from itertools import product

import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.report.text.diagnosis_facts import DiagnosisFacts, write_value
from islands.report.text.diagnosis_statements import (
    describe_causes,
    describe_diagnosis,
    describe_headline,
    describe_verdict,
)
from islands.report.text.templates import write, write_named
from support.diagnosis_documents import CAUSE, GAIN, make_document
from support.statements import EMPTY, find_contradictions


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


@pytest.mark.parametrize(
    ("name", "document"), [(name, each) for name, cases in CASES.items() for each in cases]
)
def test_a_statement_is_written_and_complete(name, document):
    facts = DiagnosisFacts(document)
    groups = {"verdict", "detail", name} - {"cause"}
    written = [each for group in groups for each in write_named("diagnosis.txt", group, f=facts)]
    written += [("cause", text) for text in describe_causes(document)]
    assert name in dict(written)
    assert not [each for each in written if EMPTY.search(each[1])]
    assert not find_contradictions(" ".join(describe_diagnosis(document)))


def test_every_statement_has_a_case():
    source = (files("islands.report.text") / "templates" / "diagnosis.txt").read_text()
    assert set(re.findall(r"block (\w+)", source)) == set(CASES)


def text(verdict, **changes):
    return "\n".join(describe_diagnosis(make_document(verdict, **changes)))


@pytest.mark.parametrize("verdict", Verdict)
@pytest.mark.parametrize(("confidence", "error"), list(product((0.3, 0.9), (0.01, 0.4))))
def test_one_statement_gives_the_verdict(verdict, confidence, error):
    causes = (
        [{**CAUSE, "confidence": confidence}]
        if verdict not in ("nothing", "noise", "unknown", "stopped")
        else []
    )
    document = make_document(str(verdict), effects=causes, calibrated_rmse=error)
    assert len(write("diagnosis.txt", "verdict", f=DiagnosisFacts(document))) == 1


@pytest.mark.parametrize(
    ("after", "low", "extent"),
    [
        (0.012, 95.0, "which explains the discrepancy."),
        (0.1, 40.0, "which explains most of the discrepancy."),
        (0.19, 2.0, "which explains a part of the discrepancy."),
        (0.19, -1.0, "which explains the discrepancy in the samples used for estimation alone."),
    ],
)
def test_the_extent_is_that_of_the_held_out_data(after, low, extent):
    gain = {**GAIN, "after": {"rmse": after, "mape": 1.0}, "ci95": [low, 99.0]}
    assert describe_verdict(make_document("named", effects=[CAUSE], gain=gain)).endswith(extent)


def test_a_gain_whose_interval_includes_zero_is_no_gain():
    gain = {**GAIN, "after": {"rmse": 0.202, "mape": 1.0}, "reduction_percent": -1.0, "ci95": [-3.0, 1.0]}
    said = text("family", effects=[{**CAUSE, "free_form": True}], gain=gain)
    assert "the RMSE does not fall significantly: 0.2 um" in said
    assert "the RMSE falls" not in said


@pytest.mark.parametrize(("confidence", "said"), [(0.5, "probably lacks"), (0.9, "lacks")])
def test_a_cause_next_to_other_probable_ones_is_called_probable(confidence, said):
    causes = [CAUSE, {**CAUSE, "name": "jump", "confidence": confidence}]
    assert text("named", effects=causes, gain=GAIN).startswith(
        f"The simulation {said} known effects, delay and"
    )
    assert text("named", effects=causes[1:], gain=GAIN).startswith(
        f"The simulation {said} a known effect, jump, which"
    )


def test_causes_have_plain_names_before_those_of_the_program():
    titles = {
        "delay": "delay of the input",
        "sensor-lag": "lag of the sensor",
        "input-offset:upper": "offset of the input at upper",
        "missing-term": "missing term",
    }
    causes = [
        {**CAUSE, "equivalents": ["sensor-lag", "own-effect"]},
        {**CAUSE, "name": "input-offset", "place": "upper", "parameters": {}},
    ]
    said = text("named", effects=causes, gain=GAIN, titles=titles)
    assert said.startswith(
        "The simulation lacks known effects, delay of the input (`delay`) and offset of the input at upper "
        "(`input-offset`), which explain"
    )
    assert "  delay of the input (`delay`): tau = 0.03 s" in said
    assert "does not distinguish it from lag of the sensor (`sensor-lag`), own-effect" in said
    term = {**CAUSE, "name": "missing-term", "family": "discovered", "term": "a1*u in output"}
    said = text("discovered", effects=[term], gain=GAIN, titles=titles)
    assert "  missing term a1*u in output (`missing-term`): tau = 0.03 s" in said
    candidates = [{"name": "sensor-lag", "score": 3.0, "eta": 1.0}]
    said = text("unknown", candidates=candidates, titles=titles)
    assert "(decrease of the BIC): lag of the sensor (`sensor-lag`): 3.0." in said


def test_effects_of_states_are_named_with_the_state():
    first, second = "input-offset:upper", "state-clip:lower"
    causes = [
        {**CAUSE, "name": "input-offset", "place": "upper", "parameters": {first: _value(2.0, "V")}},
        {**CAUSE, "name": "state-clip", "place": "lower", "parameters": {}},
    ]
    causes[1]["parameters"] = {second: _value(7.0, "V"), f"{second} caught": _value(0.5, "")}
    said = text("named", effects=causes, gain=GAIN)
    assert said.startswith(
        "The simulation lacks known effects, input-offset of upper and state-clip of lower,"
    )
    assert "input-offset of upper: 2 V; confidence" in said
    assert "state-clip of lower: 7 V, caught = 0.5; confidence" in said


@pytest.mark.parametrize(("delay", "stated"), [(-0.0002, True), (0.014, True), (0.03, False)])
def test_a_delay_of_a_sample_may_be_that_of_the_recording(delay, stated):
    said = text("named", effects=[{**CAUSE, "parameters": {"tau": _value(delay, "s")}}], gain=GAIN)
    assert ("the order in which input and output are recorded" in said) == stated


def test_limits_of_the_input_have_its_unit():
    ranges = [{"name": "force_N", "unit": "N", "low": -10.0, "high": 4.0, "rate": 3.0}]
    saturation = {**CAUSE, "name": "input-saturation", "parameters": {"cut": _value(0.3, "")}}
    rate = {**CAUSE, "name": "rate-limit", "parameters": {"inverse_rate": _value(0.25, "s/N")}}
    said = text("named", effects=[saturation, rate], gain=GAIN, extension={"ranges": ranges, "refusal": None})
    assert "input-saturation limits force_N to 7 N; rate-limit limits the rate of force_N to 4 N/s." in said
    assert " limits " not in text("named", effects=[saturation], gain=GAIN)


@pytest.mark.parametrize(("error", "stated"), [(0.0184, False), (0.0186, True)])
def test_an_error_that_grows_is_no_noise_of_constant_size(error, stated):
    said = text("noise", calibrated_rmse=error, noise_floor_rmse=0.0123)
    assert ("times the residual in the samples used for estimation, 0.012 um. Noise of" in said) == stated


def test_agreement_is_stated_with_its_error_and_contradicted_by_a_large_one():
    assert "the RMSE is 0.011 um" in (near := text("nothing", calibrated_rmse=0.011))
    assert near.startswith("No significant discrepancy: the simulation agrees")
    assert "; the RMSE is at the floor" in near
    far = text("nothing", calibrated_rmse=0.2)
    assert far.startswith("No significant discrepancy in the samples used for estimation, but the error of")


def test_the_stated_noise_is_compared_with_the_error_once():
    claim = {"rms": 0.0123, "correlation_time": 0.0, "noise_level": 0.01}
    said = "The stated noise is 0.01 um; the RMSE is 1.1 times it."
    assert said in text("named", effects=[CAUSE], gain=GAIN, noise_claim=claim)
    assert "The stated noise is" not in text("nothing", noise_claim=claim)
    finding = {"name": "above-noise-level", "description": "Loud.", "advice": "Measure.", "errors": None}
    assert "The stated noise is" not in text("unknown", noise_claim=claim, record_findings=[finding])
    assert "The stated noise is" not in text("named", effects=[CAUSE], gain=GAIN)


def test_large_noise_may_hide_a_discrepancy():
    noise = {**CAUSE, "name": "coloured-noise", "eta": None}
    assert "such as a missing input" in text(
        "nothing", effects=[noise], calibrated_rmse=0.5, noise_floor_rmse=0.5
    )
    assert "not excluded" not in text("nothing", effects=[noise], calibrated_rmse=0.01)
    assert "The noise is large" in text("nothing", calibrated_rmse=0.5, noise_floor_rmse=0.5)
    assert "not excluded" not in text("nothing", calibrated_rmse=0.5)  # the noise is small


def test_a_correction_that_a_calibration_hides_removes_no_error():
    gross = {**CAUSE, "name": "sign", "family": "gross", "eta": 1.0}
    finding = {"name": "sign", "description": "The sign seems to be flipped.", "advice": "Multiply by -1."}
    for after, stated in ((0.01, True), (0.3, False)):
        errors = {"before": 0.3, "after": after}
        said = text("gross error", effects=[gross], record_findings=[{**finding, "errors": errors}])
        assert ("100 % of the mean squared error" in said) == stated
        assert "Record: The sign seems to be flipped. Multiply by -1." in said


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


@pytest.mark.parametrize(("better", "said"), [(0, "of at most 0.024."), (1, "of 0.049."), (40, "of 1.")])
def test_p_value_is_bounded_by_the_number_of_records(better, said):
    alarms = {"value": 0.0, "ci95": [0.0, 0.088], "of": 40}
    limits = {"delay": {"strength": 0.1, "unit": "s", "misfit_sigma": 0.2}, "jump": None}
    tested = {"false_alarm_rate": alarms, "p_value": (1 + better) / 41, "detection_limits": limits}
    found = text("nothing", **tested, tested_misfits=[0.05, 6.4])
    assert said in found
    assert "Of 2 effects, 1 can be detected on this record, up to a misfit of 6.4 times the noise." in found


def test_documents_of_earlier_versions_are_described():
    document = make_document("named", effects=[CAUSE], gain=GAIN)
    for name in ("held_out_part", "output_std", "calibrated_rmse", "tested_misfits"):
        document.pop(name, None)
    assert "On the held-out data, excluded from fitting, the RMSE falls from 0.2 um" in "\n".join(
        describe_diagnosis(document)
    )


def test_contradictions_are_found():
    said = text("nothing")
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


@pytest.mark.parametrize("verdict", Verdict)
def test_the_headline_is_a_part_of_the_sentences(verdict):
    finding = {
        "name": "time-offset",
        "description": "The output is late.",
        "advice": "Shift it.",
        "errors": None,
    }
    document = make_document(str(verdict), effects=[CAUSE], record_findings=[finding])
    headline = describe_headline(document)
    assert headline[0] == describe_verdict(document)
    assert set(headline) <= {line.strip() for line in describe_diagnosis(document)}
    assert any("the RMSE" in line or "Record: " in line for line in headline)
