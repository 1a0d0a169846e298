"""Statements about a diagnosis: each follows from the numbers of its document."""

import re
from itertools import product

import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.report.text.diagnosis_statements import (
    VERDICTS,
    DiagnosisFacts,
    describe_diagnosis,
    describe_headline,
    describe_verdict,
    find_statements,
    name_reference,
    write_value,
)
from support.diagnosis_documents import CAUSE, GAIN, make_document
from support.statements import find_contradictions


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
    assert len(find_statements(VERDICTS, DiagnosisFacts(document))) == 1


def test_noise_for_which_nothing_decides_is_left_to_the_user():
    said = describe_verdict(make_document("noise"))
    assert said == (
        "No cause is found, and the residual is not white: the simulation is correct if noise of 0.012 um "
        "with a correlation time of 0.32 s is plausible for your sensor."
    )
    assert "record the output at rest" in text("noise")
    assert "record the output at rest" not in text("nothing")
    claim = {"rms": 0.0123, "correlation_time": 0.318, "noise_level": 0.01}
    assert "within the stated noise of 0.01 um" in describe_verdict(
        make_document("nothing", noise_claim=claim)
    )
    assert "within the noise." in describe_verdict(make_document("nothing", noise_claim=None))


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


def test_a_free_curve_states_the_law_that_it_resembles():
    law = {
        "law": "absolute value",
        "formula": "y + 0.98 |y|",
        "parameter": "factor",
        "value": 0.98,
        "unit": "",
    }
    said = text("family", effects=[{**CAUSE, "name": "output-curve", "free_form": True, "resembles": law}])
    assert "output-curve, which resembles an absolute value: y + 0.98 |y|; tau = 0.03 s" in said


def test_a_cause_that_others_exceed_is_uncertain():
    unlikely = {**CAUSE, "confidence": 0.36, "equivalents": ["sensor-lag"]}
    said = text("named", effects=[unlikely], gain=GAIN)
    assert said.startswith(
        "There is a discrepancy, whose cause is uncertain: the most probable one explains it."
    )
    assert "The simulation lacks" not in said
    share = "0.36, 99 % of the misfit above the noise floor"
    assert f"{share}; this record does not distinguish it from sensor-lag" in said


@pytest.mark.parametrize(("confidence", "said"), [(0.5, "probably lacks"), (0.9, "lacks")])
def test_a_cause_next_to_other_probable_ones_is_called_probable(confidence, said):
    causes = [CAUSE, {**CAUSE, "name": "jump", "confidence": confidence}]
    assert text("named", effects=causes, gain=GAIN).startswith(
        f"The simulation {said} known effects, delay and"
    )
    assert text("named", effects=causes[1:], gain=GAIN).startswith(
        f"The simulation {said} a known effect, jump, which"
    )


def test_a_claimed_cause_is_explained_with_the_error_without_it():
    explained = {
        **CAUSE,
        "error_share": 0.9876,
        "noise_share": 0.0049,
        "summary": "The input acts later: u(t - tau)",
        "distinguished_by": "a phase that grows with the frequency",
        "occurs_in": "sampling and communication",
    }
    said = text("named", effects=[explained], gain=GAIN)
    assert "without it, the RMSE is 8.98 times as large. The input acts later" in said
    assert "Distinguished by: a phase that grows with the frequency. Occurs in: sampling" in said
    small = {**explained, "error_share": 0.06}
    assert "without it, the RMSE is 3.1 % larger. The input" in text("named", effects=[small], gain=GAIN)
    assert "Occurs in" not in text("named", effects=[{**explained, "claimed": False}], gain=GAIN)
    # Gains and parameters look alike: nothing in the record distinguishes them.
    assert "Distinguished by" not in text("named", effects=[{**explained, "family": "scale"}], gain=GAIN)


def test_the_extended_simulation_is_stated_with_its_values():
    said = text("named", effects=[CAUSE], gain=GAIN, equations="dx/dt = u - k*x", calibrated={"k": 2.0})
    assert "Extended simulation: dx/dt = u - k*x; k = 2; with delay." in said
    states = {"k": 2.0, "initial x": 0.3}
    assert "k = 2; with delay." in text(
        "named", effects=[CAUSE], gain=GAIN, equations="dx/dt = u - k*x", calibrated=states
    )
    term = {**CAUSE, "name": "missing-term", "family": "discovered", "term": "a1*u in output"}
    term["parameters"] = {"a1": _value(4.0, "N")}
    found = text("discovered", effects=[term], gain=GAIN, calibrated={**states, "a1": 4.0})
    assert "Calibrated with them: k = 2." in found
    assert "Extended simulation" not in text("unknown", equations="dx/dt = u - k*x", calibrated={"k": 2.0})


EXTENSION = {
    "equations": ["dx/dt = u(t - tau) - k*x", "output = x"],
    "values": [{"name": "tau", "effect": "delay", "value": 0.03, "unit": "s", "ci95": [0.02, 0.04]}],
    "notes": ["u is force_N"],
}


def test_the_equations_of_the_extended_simulation_contain_its_effects():
    said = text("named", effects=[CAUSE], gain=GAIN, calibrated={"k": 2.0}, extension=EXTENSION)
    assert (
        "Extended simulation: dx/dt = u(t - tau) - k*x; output = x. Its values: k = 2, tau = 0.03 s (0.02 to "
        "0.04). u is force_N."
    ) in said
    assert "with delay" not in said


def test_contradictions_of_the_extension_are_stated():
    found = {**EXTENSION, "contradictions": ["Offset: an empty tank loses 1 V/s.", "Another one."]}
    lines = text("named", effects=[CAUSE], gain=GAIN, extension=found).splitlines()
    assert found["contradictions"] == [line for line in lines if line in found["contradictions"]]


def test_equations_with_terms_have_their_coefficients():
    term = {**CAUSE, "name": "missing-term", "family": "discovered", "term": "a1*u in output"}
    term["parameters"] = {"a1": _value(4.0, "N")}
    extension = {**EXTENSION, "equations": ["output = y_sim + a1*u"], "values": [], "notes": []}
    said = text(
        "discovered", effects=[term], gain=GAIN, extension=extension, calibrated={"k": 2.0, "a1": 4.0}
    )
    assert "Extended simulation: output = y_sim + a1*u. Its values: k = 2, a1 = 4 N" in said
    assert not re.search("^Equations:|Calibrated with them", said, re.MULTILINE)
    other = {"equations": "output = y_sim + a1*u", "effects": [], "nearest": [], "worse_by": -1.0}
    said = text("named", effects=[CAUSE], gain=GAIN, extension=EXTENSION, discovered=other)
    assert "Equations that explain the record as well: output = y_sim + a1*u" in said


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


def test_recordings_are_named_with_their_part():
    record = make_document("named")["record"] | {"start": 0.0, "segments": [100, 50, 50]}
    record["recordings"] = ["a.csv", "b.csv", "c.csv"]
    held_out = {"held_out_part": "the 2 validation recordings", "estimation_samples": 100}
    said = text("named", effects=[CAUSE], gain=GAIN, record=record, **held_out)
    assert (
        "Fitted to a.csv; the 2 validation recordings: b.csv and c.csv, in the figures from 1 s on." in said
    )
    one = text("named", effects=[CAUSE], gain=GAIN, record=record, estimation_samples=150 - 1)
    assert "Fitted to" not in one


def test_a_calibration_that_does_not_carry_over_is_stated():
    values = {"calibrated": {"k": 2.0}, "effects": [CAUSE], "gain": GAIN}
    assert "do not carry over" in text("named", **values, as_given_rmse=0.1)
    assert "do not carry over" not in text("named", **values, as_given_rmse=0.199)


def test_a_coloured_remainder_is_a_disturbance_or_dynamics():
    noise = {**CAUSE, "name": "coloured-noise", "eta": None}
    said = text("named", effects=[CAUSE, noise], gain=GAIN)
    assert "What remains is correlated over 0.32 s. If the sensor has no such noise" in said
    assert "is correlated over" not in text("nothing", effects=[noise])
    short = {"rms": 0.0123, "correlation_time": 0.02, "noise_level": None}
    assert "is correlated over" not in text("named", effects=[CAUSE, noise], gain=GAIN, noise_claim=short)


def test_causes_that_the_record_would_separate_may_imitate_another_one():
    pair = {"causes": ["delay", "jump"], "recorded": {"is_sufficient": True}}
    said = text("named", effects=[CAUSE], gain=GAIN, next_experiment={"pairs": [pair]})
    assert "If delay or jump were the cause, this record would tell them apart" in said
    pair["recorded"]["is_sufficient"] = False
    assert "tell them apart" not in text(
        "named", effects=[CAUSE], gain=GAIN, next_experiment={"pairs": [pair]}
    )


def test_values_of_both_parts_are_compared():
    value = {"name": "delay tau", "unit": "s", "estimation": 0.03, "validation": 0.031, "agrees": True}
    exchange = {"gain": GAIN, "values": [value]}
    said = text("named", effects=[CAUSE], gain=GAIN, exchange=exchange)
    assert "Both parts have the same values (delay tau = 0.03 and 0.031 s), within 10 %" in said
    exchange["values"] = [value, {**value, "name": "jump", "agrees": False}]
    said = text("named", effects=[CAUSE], gain=GAIN, exchange=exchange)
    assert "Both parts have different values: jump = 0.03 and 0.031 s. The system differs" in said
    jump = {**CAUSE, "name": "jump", "depends_on_time": True}
    said = text("named", effects=[CAUSE, jump], gain=GAIN, exchange=exchange)
    assert "0.031 s. They belong to functions of the time, and are those of one recording." in said
    term = {**CAUSE, "name": "missing-term", "term": "a1*(t*u) in dx/dt", "depends_on_time": True}
    term["parameters"] = {"a1": _value(0.03, "1/s")}
    exchange["values"] = [{**value, "name": "a1", "agrees": False}]
    assert "They belong to functions of the time" in text(
        "discovered", effects=[term], gain=GAIN, exchange=exchange
    )


def test_a_cause_that_depends_on_time_is_said_to_be_that_of_the_record():
    cause = {**CAUSE, "name": "gain-step", "depends_on_time": True}
    said = text("named", effects=[cause], gain=GAIN)
    assert "gain-step: a function of the time of this record, which the extended simulation repeats" in said
    assert "function of the time" not in text("named", effects=[CAUSE], gain=GAIN)
    facts = {"held_out_part": "the validation recording", "is_time_left_out": True}
    said = text("named", effects=[cause], gain=GAIN, **facts)
    assert "It contradicts the validation recording, where the simulation leaves it out." in said


def test_limits_of_the_input_have_its_unit():
    ranges = [{"name": "force_N", "unit": "N", "low": -10.0, "high": 4.0, "rate": 3.0}]
    saturation = {**CAUSE, "name": "input-saturation", "parameters": {"cut": _value(0.3, "")}}
    rate = {**CAUSE, "name": "rate-limit", "parameters": {"inverse_rate": _value(0.25, "s/N")}}
    said = text("named", effects=[saturation, rate], gain=GAIN, extension={"ranges": ranges, "refusal": None})
    assert "input-saturation limits force_N to 7 N; rate-limit limits the rate of force_N to 4 N/s." in said
    assert " limits " not in text("named", effects=[saturation], gain=GAIN)


@pytest.mark.parametrize(("rate", "said"), [(1.5, "from 0.5 to 15.5 Hz"), (-0.04, "from 0.5 to 0.1 Hz")])
def test_a_sweep_has_its_frequencies_at_both_ends_of_the_record(rate, said):
    parameters = {"frequency": _value(0.5, "Hz"), "rate": _value(rate, "Hz/s")}
    record = {**make_document("named")["record"], "samples": 1000}
    for name in ("swept-disturbance", "swept-interference"):
        cause = {**CAUSE, "name": name, "parameters": parameters}
        stated = text("named", effects=[cause], gain=GAIN, record=record)
        assert f"{name} sweeps {said} within the record: look for a " in stated
        assert (" runs up at " in stated, " runs down at " in stated) == (rate > 0.0, rate < 0.0)
    assert " sweeps " not in text("named", effects=[CAUSE], gain=GAIN)


@pytest.mark.parametrize(("error", "stated"), [(0.0184, False), (0.0186, True)])
def test_an_error_that_grows_is_no_noise_of_constant_size(error, stated):
    said = text("noise", calibrated_rmse=error, noise_floor_rmse=0.0123)
    assert ("times the residual in the samples used for estimation, 0.012 um. Noise of" in said) == stated


def test_agreement_is_stated_with_the_calibrated_values():
    values = {"k": 2.0, "initial x": 0.3, "state 1 (recording 2)": 0.1}
    assert "Calibrated: k = 2." in text("nothing", calibrated=values)
    assert "Calibrated" not in text("unknown", calibrated=values)


@pytest.mark.parametrize(
    ("simulation", "said"),
    [
        ("second-order", "In the formulas, x is the output, travel_um, and x' its rate."),
        ("linear:2", "In the formulas, x is the input, force_N, and x' its rate."),
    ],
)
def test_the_coordinate_of_a_force_is_named(simulation, said):
    friction = {**CAUSE, "summary": "Dry friction: - F sign(x')", "distinguished_by": "", "occurs_in": ""}
    assert said in text("named", effects=[friction], gain=GAIN, simulation=simulation)
    assert "In the formulas" not in text("named", effects=[friction], gain=GAIN, simulation="fmu")
    assert "In the formulas" not in text("named", effects=[CAUSE], gain=GAIN, simulation=simulation)


def test_a_gain_on_one_record_asks_for_another_one():
    assert "Causes and gain rest on one record" in text("named", effects=[CAUSE], gain=GAIN)
    second = text("named", effects=[CAUSE], gain=GAIN, held_out_part="the validation recording")
    assert "Causes and gain rest on one record" not in second
    assert "rest on one record" not in text("unknown")


def test_terms_are_named_with_their_equations_and_share_one_part_of_the_error():
    terms = [
        {
            **CAUSE,
            "name": "missing-term",
            "family": "discovered",
            "term": f"a{number}*u in output",
            "error_share": 0.98,
            "noise_share": 0.02,
            "parameters": {},
        }
        for number in (1, 2)
    ]
    said = text("discovered", effects=terms, gain=GAIN)
    assert "missing-term a1*u in output; confidence 0.98\n" in said
    assert said.count("Without all terms and effects, the RMSE is 7.07 times as large.") == 1
    # The share of an effect is that of another error, and may exceed the share of all causes together.
    effect = {**CAUSE, "error_share": 0.99, "noise_share": 0.01}
    both = text("discovered", effects=[*terms, effect], gain=GAIN)
    assert "without it, the RMSE is 10 times as large" in both
    assert "Errors without an effect are those of another calibration" in both
    assert "another calibration" not in said


def test_agreement_is_stated_with_its_error_and_contradicted_by_a_large_one():
    assert "the RMSE is 0.011 um" in (near := text("nothing", calibrated_rmse=0.011))
    assert near.startswith("No significant discrepancy: the simulation agrees")
    assert "; the RMSE is at the floor" in near
    far = text("nothing", calibrated_rmse=0.2)
    assert far.startswith("No significant discrepancy in the samples used for estimation, but the error of")


def test_the_noise_floor_is_defined_and_says_how_it_is_measured():
    bound = text("nothing")
    assert (
        "The noise floor, the RMSE of the noise alone, is at most 0.01 um (an input that repeats three times "
        "would measure it); the RMSE is" in bound
    )
    measured = text("nothing", noise_floor_is="measured by repeated periods")
    assert "is 0.01 um, measured from repeated periods; the RMSE is" in measured


def test_the_stated_noise_is_compared_with_the_error_once():
    claim = {"rms": 0.0123, "correlation_time": 0.0, "noise_level": 0.01}
    said = "The stated noise is 0.01 um; the RMSE is 1.1 times it."
    assert said in text("named", effects=[CAUSE], gain=GAIN, noise_claim=claim)
    assert "The stated noise is" not in text("nothing", noise_claim=claim)
    finding = {"name": "above-noise-level", "description": "Loud.", "advice": "Measure.", "errors": None}
    assert "The stated noise is" not in text("unknown", noise_claim=claim, record_findings=[finding])
    assert "The stated noise is" not in text("named", effects=[CAUSE], gain=GAIN)


def test_coefficients_of_coloured_noise_have_names():
    values = {"pole": _value(0.83, ""), "order": _value(7.0, ""), "difference order": _value(0.0, "")}
    noise = {**CAUSE, "name": "coloured-noise", "eta": None, "parameters": values}
    said = text("nothing", effects=[noise])
    assert "coloured-noise: largest pole = 0.83, order of the autoregression = 7, confidence" in said
    values["difference order"] = _value(0.3, "")
    assert "order of the long memory = 0.3" in text("nothing", effects=[noise])


def test_large_noise_may_hide_a_discrepancy():
    noise = {**CAUSE, "name": "coloured-noise", "eta": None}
    assert "such as a missing input" in text(
        "nothing", effects=[noise], calibrated_rmse=0.5, noise_floor_rmse=0.5
    )
    assert "not excluded" not in text("nothing", effects=[noise], calibrated_rmse=0.01)
    assert "The noise is large" in text("nothing", calibrated_rmse=0.5, noise_floor_rmse=0.5)
    assert "not excluded" not in text("nothing", calibrated_rmse=0.5)  # the noise is small


def test_properties_of_the_noise_are_no_causes():
    noise = {**CAUSE, "name": "outliers", "eta": None, "parameters": {"size": _value(0.1, "1")}}
    verdict, cause, *details = describe_diagnosis(make_document("named", effects=[CAUSE, noise], gain=GAIN))
    assert cause.startswith("  delay: ")
    assert "Sampling and noise: outliers: size = 0.1, confidence 0.98." in details
    assert "a known effect, delay," in verdict


def test_wrong_values_and_forms_are_no_effects_that_a_simulation_lacks():
    gain, form = {**CAUSE, "name": "sensor-gain", "family": "scale"}, {**CAUSE, "name": "core-shape"}
    assert text("named", effects=[gain], gain=GAIN).startswith("A gain or a parameter of the simulation is")
    assert text("named", effects=[form], gain=GAIN).startswith("The form of the model is wrong, which")


def test_the_reference_of_a_gain_is_named():
    assert name_reference(make_document("named", gain=GAIN)) == "calibrated, without the effects"
    other = make_document("named", gain=GAIN, calibrated_rmse=0.012)
    assert name_reference(other) == "as given, without the effects"
    column = make_document("named", gain=GAIN, calibrated={})
    assert name_reference(column) == "as given, without the effects"


def test_the_nearest_effects_of_an_unknown_cause_improve_the_fit():
    near, far = (
        {"name": name, "score": score, "eta": 1.0} for name, score in (("delay", 3.0), ("jump", -1.0))
    )
    said = text("unknown", candidates=[near, far], remainder={"output": 5.3})
    nearest = "Nearest effects, none of which is confirmed, with their scores (decrease of the BIC):"
    assert f"{nearest} delay: 3.0." in said
    assert "The remaining residual depends on (standard deviations beyond chance): output (5.3)." in said
    assert "No effect alone improves the fit" in text("unknown", candidates=[far])


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


def test_no_cause_is_certain_or_impossible():
    assert "confidence below 0.01, " in text("named", effects=[{**CAUSE, "confidence": 0.001}], gain=GAIN)
    assert "confidence above 0.99, " in text("named", effects=[{**CAUSE, "confidence": 1.0}], gain=GAIN)


def test_an_effect_that_is_not_claimed_shares_the_gain():
    causes = [CAUSE, {**CAUSE, "name": "jump", "claimed": False}]
    said = text("named with remainder", effects=causes, gain=GAIN, remainder={"input": 5.0})
    assert said.startswith(
        "The simulation lacks a known effect, delay, which, with those that are not claimed, explains most "
        "of the discrepancy; significant structure remains."
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


def _value(value, unit):
    return {"value": value, "unit": unit, "ci95": None}


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
