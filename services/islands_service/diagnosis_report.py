"""The report of a diagnosis: plain words first, numbers under them, figures; one HTML file."""

import base64
import io
from typing import Any

from islands.discrepancy.decision import Finding, Verdict
from islands.discrepancy.diagnosis import Diagnosis
from islands.figures.discrepancy import DISCREPANCY_FIGURES
from islands.figures.style import save
from islands_service.report import TEMPLATES

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


def in_words(found: Diagnosis) -> str:
    """Say a diagnosis in a few plain lines."""
    lines = [_VERDICTS[found.verdict]]
    lines += [f"  {_finding(finding)}" for finding in found.effects]
    if found.verdict == Verdict.UNKNOWN:
        nearest = ", ".join(candidate.name for candidate in found.candidates[:3])
        lines.append(
            f"  nearest: {nearest}; what is left depends on: {', '.join(found.remainder) or 'its own past'}"
        )
    if found.gain is not None:
        gain, unit = found.gain, found.record.output_unit
        low, high = gain.ci95
        lines.append(
            f"On data that nothing else has seen the RMSE falls from {gain.before.rmse:.3g} to "
            f"{gain.after.rmse:.3g} {unit}, by {gain.reduction_percent:.1f} % ({low:.1f} to {high:.1f}); "
            f"noise alone is {gain.noise_floor.rmse:.3g} {unit} at the most."
        )
    if found.decisive_experiment:
        lines.append(f"To tell apart what this record cannot: {found.decisive_experiment}.")
    return "\n".join(lines)


def _finding(finding: Finding) -> str:
    values = ", ".join(
        f"{name} = {each.value:.4g}{f' {each.unit}' if each.unit else ''}"
        + ("" if each.ci95 is None else f" ({each.ci95[0]:.4g} to {each.ci95[1]:.4g})")
        for name, each in finding.parameters.items()
    )
    share = "" if finding.eta is None else f", {100 * finding.eta:.0f} % of the misfit"
    or_else = f"; cannot be told from {', '.join(finding.equivalents)}" if finding.equivalents else ""
    return f"{finding.name}: {values}; confidence {finding.confidence:.2f}{share}{or_else}"


def report(name: str, found: Diagnosis) -> bytes:
    """Write the report of a diagnosis.

    Parameters
    ----------
    name : str
        Of the record.
    """
    figures = [(_CAPTIONS[each], _inline(draw(found))) for each, draw in DISCREPANCY_FIGURES.items()]
    text = TEMPLATES.get_template("diagnosis.html").render(
        name=name,
        found=found,
        verdict=_VERDICTS[found.verdict],
        findings=[_finding(finding) for finding in found.effects],
        words=in_words(found),
        figures=figures,
    )
    return text.encode()


def _inline(figure: Any) -> str:
    stream = io.BytesIO()
    save(figure, stream)
    return f"data:image/svg+xml;base64,{base64.b64encode(stream.getvalue()).decode()}"
