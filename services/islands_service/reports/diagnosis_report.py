"""HTML report of a diagnosis in a single file: sentences, numbers and figures."""

import base64
import io
from math import ceil, log10
from typing import Any

from islands.discrepancy.detectability import NOTHING, SelfTest
from islands.discrepancy.diagnosis_result import Diagnosis
from islands.discrepancy.findings import ResidualFormula
from islands.discrepancy.inference.finding import Finding, Value
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.surrogates import STRENGTHS
from islands.figures.discrepancy import DISCREPANCY_FIGURES
from islands.figures.form_values import draw_effect_shape, draw_free_forms, list_free_forms
from islands.figures.style import save
from islands_service.reports.identification_report import TEMPLATES

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

#: Captions of the figures, in the order of the report.
_CAPTIONS = {
    "over-time": "Measured, simulated and extended output, and the residuals",
    "loops": "Output over input, and the residual over the input",
    "residual": "Structure of the residual before and after",
    "ladder": "Gain of each effect alone",
}


#: Sentence for "nothing" if properties of the noise were found.
_NOISE = "No significant discrepancy: the simulation is correct within the noise, whose kind was identified."


def summarise(found: Diagnosis, proposal: ResidualFormula | None = None) -> str:
    """Summarise a diagnosis as plain text."""
    lines = [_verdict(found)]
    lines += [f"  {_finding(finding)}" for finding in found.effects]
    lines += [f"Record: {each.text}" for each in found.record_findings]
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
            f"the noise floor is {gain.noise_floor.rmse:.3g}{unit}, {_floor(found)}."
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


def _verdict(found: Diagnosis) -> str:
    return _NOISE if found.verdict == Verdict.NOTHING and found.noise else _VERDICTS[found.verdict]


def _floor(found: Diagnosis) -> str:
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


def _finding(finding: Finding) -> str:
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


def _limits(tested: SelfTest) -> list[tuple[str, str, str]]:
    """Return for each effect its name, the smallest detected strength, and the misfit at this strength."""
    return [
        (name, f"not up to {STRENGTHS[-1]:g} times the noise", "")
        if limit is None
        else (name, _amount(limit.strength, limit.unit), f"{limit.misfit:.2g} times the noise")
        for name, limit in tested.detection_limits.items()
    ]


def _amount(value: float, unit: str) -> str:
    """Format a strength with its unit; one without a unit is a fraction, shown in per cent."""
    return f"{value:.3g} {unit.replace('/', ' per ')}" if unit else f"{100 * value:.3g} %"


def _mistaken(tested: SelfTest) -> list[tuple[str, str, int]]:
    """Return injected effect, named effect and count of each confusion, without missed effects."""
    return [
        (injected, named, count)
        for (injected, named), count in tested.confusion.items()
        if named not in (injected, NOTHING)
    ]


def diagnosis_report(
    name: str, found: Diagnosis, tested: SelfTest | None = None, proposal: ResidualFormula | None = None
) -> bytes:
    """Write the report of a diagnosis.

    Parameters
    ----------
    name : str
        Name of the record.
    tested : SelfTest, optional
        Detection limits and false-alarm rate on the record.
    proposal : ResidualFormula, optional
        Formula for the unexplained residual.
    """
    figures = [
        (_CAPTIONS[each], _inline(draw(found)))
        for each, draw in DISCREPANCY_FIGURES.items()
        if found.candidates or each != "ladder"
    ]
    if list_free_forms(found):
        figures.insert(1, ("Shape of the missing effect", _inline(draw_free_forms(found))))
    if found.shape is not None:
        caption = "Shape of the effect, and of a free curve in its place"
        figures.insert(1, (caption, _inline(draw_effect_shape(found.shape))))
    text = TEMPLATES.get_template("diagnosis.html").render(
        name=name,
        found=found,
        verdict=_verdict(found),
        left_out=describe_left_out(found),
        findings=[_finding(finding) for finding in found.effects],
        proposal=proposal,
        floor=_floor(found),
        figures=figures,
        tested=None if tested is None else summarise_self_test(tested),
        strengths=STRENGTHS,
        limits=[] if tested is None else _limits(tested),
        mistaken=[] if tested is None else _mistaken(tested),
    )
    return text.encode()


def _inline(figure: Any) -> str:
    stream = io.BytesIO()
    save(figure, stream)
    return f"data:image/svg+xml;base64,{base64.b64encode(stream.getvalue()).decode()}"
