"""The report of a diagnosis: plain words first, numbers under them, figures; one HTML file."""

import base64
import io
from typing import Any

from islands.discrepancy.detectability import NOTHING, SelfTest
from islands.discrepancy.diagnosis import Diagnosis, ResidualFormula
from islands.discrepancy.inference.verdict import Finding, Verdict
from islands.discrepancy.surrogates import STRENGTHS
from islands.figures.discrepancy import DISCREPANCY_FIGURES
from islands.figures.style import save
from islands_service.reports.identification_report import TEMPLATES

#: What a verdict means.
_VERDICTS = {
    Verdict.NOTHING: "Nothing significant: within this record's noise the simulation is right.",
    Verdict.NAMED: "The simulation lacks something that has a name.",
    Verdict.REMAINDER: "The simulation lacks something that has a name, and a little more that has none.",
    Verdict.UNKNOWN: "The simulation is wrong, but by none of the causes that are known here.",
}

#: What figures show, in the order of a report.
_CAPTIONS = {
    "over-time": "Where it errs: measured, simulated, extended",
    "loops": "Output over input, and the residual over the input",
    "residual": "What the residual still knows, before and after",
    "ladder": "What each effect would gain",
}


#: What it means where only sampling and noise have got a name.
_NOISE = "Nothing significant: within this record's noise, which has a name, the simulation is right."


def summarise(found: Diagnosis, proposal: ResidualFormula | None = None) -> str:
    """Say a diagnosis in a few plain lines."""
    lines = [_verdict(found)]
    lines += [f"  {_finding(finding)}" for finding in found.effects]
    if found.verdict == Verdict.UNKNOWN:
        nearest = ", ".join(candidate.name for candidate in found.candidates[:3])
        dependence = ", ".join(found.residual_structure) or "its own past"
        lines.append(f"  nearest: {nearest}; what is left depends on: {dependence}")
    if found.gain is not None:
        gain, unit = found.gain, found.record.output_unit
        low, high = gain.ci95
        lines.append(
            f"On data that nothing else has seen the RMSE falls from {gain.before.rmse:.3g} to "
            f"{gain.after.rmse:.3g} {unit}, by {gain.reduction_percent:.1f} % ({low:.1f} to {high:.1f}); "
            f"noise alone is {gain.noise_floor.rmse:.3g} {unit}, {_floor(found)}."
        )
    if found.suggested_experiment:
        lines.append(f"To tell apart what this record cannot: {found.suggested_experiment}.")
    if proposal is not None:
        lines.append(
            f"What is left follows, to {100 * proposal.explains:.0f} % on such data: {proposal.formula}"
        )
    return "\n".join(lines)


def _verdict(found: Diagnosis) -> str:
    quiet = found.verdict == Verdict.NAMED and all(
        finding.explained_fraction is None for finding in found.effects
    )
    return _NOISE if quiet else _VERDICTS[found.verdict]


def _floor(found: Diagnosis) -> str:
    """Say how well the noise is known."""
    return (
        "as repeated periods show"
        if found.is_noise_floor_measured
        else "at the most: how much of what is left is noise, a record without repeated periods cannot tell"
    )


def _finding(finding: Finding) -> str:
    values = ", ".join(
        f"{name} = {each.value:.4g}{f' {each.unit}' if each.unit else ''}"
        + ("" if each.ci95 is None else f" ({each.ci95[0]:.4g} to {each.ci95[1]:.4g})")
        for name, each in finding.parameters.items()
    )
    share = (
        ""
        if finding.explained_fraction is None
        else f", {100 * finding.explained_fraction:.0f} % of the misfit"
    )
    or_else = f"; cannot be told from {', '.join(finding.equivalents)}" if finding.equivalents else ""
    return f"{finding.name}: {values}; confidence {finding.confidence:.2f}{share}{or_else}"


def summarise_self_test(tested: SelfTest) -> str:
    """Say in a few plain lines what the analysis can do on a record."""
    alarms, limits = tested.false_alarm_rate, tested.detection_limits
    low, high = (100 * each for each in alarms.ci95)
    shown = sum(limit is not None for limit in limits.values())
    # So few records cannot show that it is rarer.
    least = "at most " if tested.p_value * (alarms.trials + 1) < 1.5 else ""
    named = alarms.value * alarms.trials
    return (
        f"Of {alarms.trials} records like this one with nothing wrong in them {named:.0f} got "
        f"a name: {100 * alarms.value:.1f} % false alarms ({low:.1f} to {high:.1f}). Chance alone makes a "
        f"candidate as good as this record's best with a probability of {least}{tested.p_value:.2g}.\n"
        f"Of {len(limits)} effects this record could show {shown}, up to a misfit of {STRENGTHS[-1]:g} times "
        "the noise."
    )


def _limits(tested: SelfTest) -> list[tuple[str, str, str]]:
    """Return a row for each effect: its name, the smallest strength that was named, and its misfit."""
    return [
        (name, f"not up to {STRENGTHS[-1]:g} times the noise", "")
        if limit is None
        else (name, _amount(limit.strength, limit.unit), f"{limit.misfit:.2g} times the noise")
        for name, limit in tested.detection_limits.items()
    ]


def _amount(value: float, unit: str) -> str:
    """Say a strength with its unit: what has none is a part of something."""
    return f"{value:.3g} {unit.replace('/', ' per ')}" if unit else f"{100 * value:.3g} %"


def _mistaken(tested: SelfTest) -> list[tuple[str, str, int]]:
    """Return what was called something else than it is, and how often; overlooked is not that."""
    return [
        (hidden, called, times)
        for (hidden, called), times in tested.confusion.items()
        if called not in (hidden, NOTHING)
    ]


def diagnosis_report(
    name: str, found: Diagnosis, tested: SelfTest | None = None, proposal: ResidualFormula | None = None
) -> bytes:
    """Write the report of a diagnosis.

    Parameters
    ----------
    name : str
        Of the record.
    tested : SelfTest, optional
        What the analysis can do on it.
    proposal : ResidualFormula, optional
        A formula for what has no name.
    """
    figures = [(_CAPTIONS[each], _inline(draw(found))) for each, draw in DISCREPANCY_FIGURES.items()]
    text = TEMPLATES.get_template("diagnosis.html").render(
        name=name,
        found=found,
        verdict=_verdict(found),
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
