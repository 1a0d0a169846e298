"""HTML report of a diagnosis: sentences, numbers and figures."""

from functools import partial

from islands.diagnosis.detectability import NOTHING, SelfTest
from islands.diagnosis.documents.result_json import diagnosis_document
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.finding import list_free_forms
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.surrogates import STRENGTHS
from islands.io.result_text.diagnosis_statements import (
    describe_causes,
    describe_details,
    describe_verdict,
    name_reference,
)
from islands.parallel import ParallelMap
from islands.reports.rendering import TEMPLATES, inline_figure

#: Captions of the figures, in the order of the report.
_CAPTIONS = {
    "over-time": "Measured and simulated output, and the residual",
    "shape": "Shape of the effect, and of a free curve in its place",
    "free-forms": "Values of the free forms",
    "loops": "Output over input, and the residual over the input",
    "residual": "Structure of the residual",
    "ladder": "Gain of each effect alone",
}


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


def _list_figures(found: Diagnosis) -> list[str]:
    """Return the names of the figures that a diagnosis has, in the order of the report."""
    has = {
        "shape": found.shape is not None,
        "free-forms": bool(list_free_forms(found.effects)),
        "ladder": bool(found.candidates),
    }
    return [name for name in _CAPTIONS if has.get(name, True)]


def _draw(found: Diagnosis, name: str) -> str:
    """Draw a figure; return the address of the embedded image."""
    # matplotlib takes half a second to import, and other processes may draw.
    from islands.figures.diagnosis import DIAGNOSIS_FIGURES  # noqa: PLC0415
    from islands.figures.form_values import draw_effect_shape, draw_free_forms  # noqa: PLC0415

    if name == "shape" and found.shape is not None:
        return inline_figure(draw_effect_shape(found.shape))
    draw = draw_free_forms if name == "free-forms" else DIAGNOSIS_FIGURES[name]
    return inline_figure(draw(found))


def diagnosis_report(
    name: str,
    found: Diagnosis,
    tested: SelfTest | None = None,
    proposal: ResidualFormula | None = None,
    parallel_map: ParallelMap = map,
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
    parallel_map : ParallelMap
        Draws the figures. The report does not depend on it.
    """
    names = _list_figures(found)
    drawn = parallel_map(partial(_draw, found), names)
    figures = [(_CAPTIONS[each], figure) for each, figure in zip(names, drawn, strict=True)]
    document = diagnosis_document(found, None, tested, proposal)
    text = TEMPLATES.get_template("diagnosis.html").render(
        name=name,
        document=document,
        verdict=describe_verdict(document),
        causes=describe_causes(document),
        details=describe_details(document),
        reference=name_reference(document),
        figures=figures,
        strengths=STRENGTHS,
        limits=[] if tested is None else _limits(tested),
        mistaken=[] if tested is None else _mistaken(tested),
    )
    return text.encode()
