"""Sentences of a diagnosis: verdict, causes, gain, and what the record could reveal."""

from math import ceil, log10

from islands.diagnosis.detectability import SelfTest
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.finding import Finding, Value
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.surrogates import STRENGTHS

#: Sentence for each verdict.
_VERDICTS = {
    Verdict.NOTHING: "No significant discrepancy: the simulation is correct within the noise of this record.",
    Verdict.NAMED: "The simulation lacks known effects, which explain the discrepancy.",
    Verdict.REMAINDER: "The simulation lacks a known effect, which explains most of the discrepancy.",
    Verdict.UNKNOWN: "The simulation is wrong, and no known effect explains the discrepancy.",
    Verdict.FAMILY: "The simulation lacks an effect of this kind, whose shape is that of no known effect.",
    Verdict.DISCOVERED: "The simulation lacks terms, which were found. Known effects alone explain less.",
    Verdict.STOPPED: "The diagnosis was stopped before a verdict: the causes are unknown.",
    Verdict.GROSS_ERROR: "Record and simulation do not match as they are: correct the record first.",
}

#: Sentence for "nothing" if properties of the noise were found.
_NOISE = "No significant discrepancy: the simulation is correct within the noise, whose kind was identified."


def summarise_diagnosis(found: Diagnosis, proposal: ResidualFormula | None = None) -> str:
    """Summarise a diagnosis as plain text."""
    lines = [describe_verdict(found)]
    lines += [f"  {describe_finding(finding)}" for finding in found.effects]
    lines += [f"Record: {each.text}" for each in found.record_findings]
    lines += [f"Reading: {step}." for step in found.record.reading]
    if (discovery := found.discovery) is not None and found.verdict == Verdict.DISCOVERED:
        lines.append(f"Equations: {discovery.equations}")
        if others := " and ".join(discovery.nearest):
            worse_by = f"{discovery.worse_by:.0f}"
            lines.append(f"With {others} instead of the terms, the score is worse by {worse_by}.")
    elif discovery is not None:
        effects = f", with {' and '.join(discovery.effects)}" if discovery.effects else ""
        lines.append(f"Equations that explain the record as well{effects}: {discovery.equations}")
    if found.verdict in (Verdict.UNKNOWN, Verdict.STOPPED):
        nearest = ", ".join(candidate.name for candidate in found.candidates[:3]) or "none yet"
        dependence = ", ".join(found.residual_structure) or "its own past"
        lines.append(f"  nearest: {nearest}; the residual depends on: {dependence}")
    if found.gain is not None:
        gain, (low, high) = found.gain, found.gain.ci95
        unit = f" {found.record.output_unit}" if found.record.output_unit else ""
        lines.append(
            f"On held-out data the RMSE falls from {gain.before.rmse:.3g} to "
            f"{gain.after.rmse:.3g}{unit}, by {gain.reduction_percent:.1f} % ({low:.1f} to {high:.1f}); "
            f"the noise floor is {gain.noise_floor.rmse:.3g}{unit}, {describe_noise_floor(found)}."
        )
    if found.suggested_experiment:
        lines.append(f"Suggested experiment to separate confounded effects: {found.suggested_experiment}.")
    if proposal is not None:
        lines.append(
            f"This formula explains {100 * proposal.explains:.0f} % of the residual on held-out data: "
            f"{proposal.formula}"
        )
    if left_out := describe_left_out(found):
        lines.append(left_out)
    return "\n".join(lines)


def describe_left_out(found: Diagnosis) -> str:
    """Return a sentence with the steps that a stopped diagnosis has left out; empty for a complete one."""
    if not found.left_out:
        return ""
    return (
        f"The diagnosis was stopped, without: {', '.join(found.left_out)}. "
        "The complete diagnosis may have another verdict."
    )


def describe_verdict(found: Diagnosis) -> str:
    """Return the verdict as a sentence."""
    return _NOISE if found.verdict == Verdict.NOTHING and found.noise else _VERDICTS[found.verdict]


def describe_noise_floor(found: Diagnosis) -> str:
    """Say how the noise floor was determined."""
    return (
        "measured from repeated periods"
        if found.is_noise_floor_measured
        else "an upper bound, because the record has no repeated periods"
    )


def _write_value(given: Value) -> str:
    """Write a value with its unit and interval, with as many digits as the width of the interval needs."""
    unit = f" {given.unit}" if given.unit else ""
    if given.ci95 is None:
        return f"{given.value:.4g}{unit}"
    low, high = given.ci95
    digits = 4
    if given.value and low < high:
        digits = max(4, ceil(log10(abs(given.value) / (high - low))) + 3)
    return f"{given.value:.{digits}g}{unit} ({low:.{digits}g} to {high:.{digits}g})"


def describe_finding(finding: Finding) -> str:
    """Describe an effect: values, confidence, share of the misfit, and equivalent effects."""
    values = ", ".join(f"{name} = {_write_value(each)}" for name, each in finding.parameters.items())
    share = (
        ""
        if finding.explained_fraction is None
        else f", {100 * finding.explained_fraction:.0f} % of the misfit"
    )
    confounded = f"; confounded with {', '.join(finding.equivalents)}" if finding.equivalents else ""
    values = f": {values}" if values else ""
    claim = "" if finding.is_claimed else "; improves the fit, but is not claimed as a cause"
    return f"{finding.name}{values}; confidence {finding.confidence:.2f}{share}{confounded}{claim}"


def summarise_self_test(tested: SelfTest) -> str:
    """Summarise the false-alarm rate and the detection limits on a record as plain text."""
    alarms, limits = tested.false_alarm_rate, tested.detection_limits
    low, high = (100 * each for each in alarms.ci95)
    shown = sum(limit is not None for limit in limits.values())
    # The number of records bounds the p-value from below.
    least = "at most " if tested.p_value * (alarms.trials + 1) < 1.5 else ""
    named = alarms.value * alarms.trials
    return (
        f"Of {alarms.trials} surrogate records without an effect, a cause was named in {named:.0f}: "
        f"{100 * alarms.value:.1f} % false alarms ({low:.1f} to {high:.1f}). A correct simulation "
        "yields a candidate as good as the best one of this record with a probability of "
        f"{least}{tested.p_value:.2g}.\n"
        f"Of {len(limits)} effects, {shown} can be detected on this record, up to a misfit of "
        f"{STRENGTHS[-1]:g} times the noise."
    )
