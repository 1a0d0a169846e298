"""HTML report of a diagnosis: sentences, numbers and figures."""

from collections.abc import Callable
from functools import partial
from math import floor

import numpy as np
from markupsafe import Markup

from islands.diagnosis.detectability import NOTHING, STRENGTHS, SelfTest
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.finding import list_free_forms
from islands.diagnosis.rate_effect import find_rate_effect
from islands.diagnosis.result import Diagnosis
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap
from islands.records.loops import has_loops
from islands.report.documents.diagnosis_json import diagnosis_document
from islands.report.documents.extension import write_extended_equations
from islands.report.pages.origin import Origin
from islands.report.pages.rendering import TEMPLATES, inline_figure, list_record
from islands.report.text.diagnosis_facts import DiagnosisFacts, write_value
from islands.report.text.facts import Document
from islands.report.text.layout import write_html
from islands.report.text.statements import describe_causes, describe_details, describe_verdict
from islands.sentences import write_one

#: Captions of the figures, in the order of the report.
_CAPTIONS = {
    "over-time": (
        "Measured output, simulated output without and with the effects (extended), the residual of each "
        "(measured minus simulated), and the input"
    ),
    "rate": (
        "Mean and band of one standard deviation of the residual over the rate that a cause acts on, without "
        "the cause, all other values being those of the extended simulation, and with it; below, what the "
        "cause adds"
    ),
    "shape": "Shape of the effect, and of a free curve in its place",
    "free-forms": "Values of the free forms",
    "loops": "A simulation that lacks a hysteresis or a curve has another loop than the measured output",
    "residual": (
        "A right simulation leaves a residual that depends on nothing: means of zero, a flat spectrum, and "
        "no autocorrelation"
    ),
    "ladder": (
        "The causes are those of the best combination, in which an effect may have another score than alone"
    ),
}

#: Name of the extended simulation in the table of errors.
_EXTENDED = "calibrated, with the effects"

#: Screened effects in the table of the report.
_MAX_CANDIDATES = 15


def _limits(tested: SelfTest, label: Callable[[str], str]) -> list[tuple[str, str, str]]:
    """Return for each effect its name, the smallest detected strength, and the misfit at this strength."""
    return [
        (_show_code(label(name)), f"not up to {STRENGTHS[-1]:g} times the noise", "")
        if limit is None
        else (
            _show_code(label(name)),
            _amount(limit.strength, limit.unit),
            f"{limit.misfit:.2g} times the noise",
        )
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


def _varies_smoothly(u: Signal) -> bool:
    """Return whether an input changes in most samples; one that is held gives rectangles over itself."""
    return bool(2 * np.count_nonzero(np.diff(u)) > u.size)


def _list_figures(found: Diagnosis) -> list[str]:
    """Return the names of the figures that a diagnosis has, in the order of the report."""
    has = {
        "rate": find_rate_effect(found) is not None,
        "loops": has_loops(found.record) and _varies_smoothly(found.record.u[:, 0]),
        "shape": found.shape is not None,
        "free-forms": bool(list_free_forms(found.effects)),
        "ladder": bool(found.candidates),
    }
    return [name for name in _CAPTIONS if has.get(name, True)]


def _draw(found: Diagnosis, name: str) -> str:
    """Draw a figure; return the address of the embedded image."""
    # matplotlib takes half a second to import, and other processes may draw.
    from islands.report.figures.diagnosis import (  # noqa: PLC0415
        DIAGNOSIS_FIGURES,
        draw_effect_shape,
        draw_free_forms,
        draw_residual_over_rate,
    )

    if name == "rate":
        return inline_figure(draw_residual_over_rate(found))
    if name == "shape" and found.shape is not None:
        return inline_figure(draw_effect_shape(found.shape))
    draw = draw_free_forms if name == "free-forms" else DIAGNOSIS_FIGURES[name]
    return inline_figure(draw(found))


def _tabulate_errors(facts: DiagnosisFacts) -> tuple[tuple[str, ...], list[tuple[str, ...]], str]:
    """Return the columns and the rows of the errors of the simulation, and a remark on them."""
    document = facts.document
    if document["verdict"] == "gross error":
        errors = document["record_findings"][0]["errors"]
        columns: tuple[str, ...] = ("error", "RMSE, % of the standard deviation of the output")
        rows: list[tuple[str, ...]] = [
            ("calibrated, record as given", f"{100 * errors['before']:.3g}"),
            ("calibrated, record corrected", f"{100 * errors['after']:.3g}"),
        ]
        return columns, rows, "Both are errors over the samples used for estimation."
    unit, gain, deviation = document["record"]["units"]["output"], document["gain"], document["output_std"]
    is_calibrated, bound = facts.is_calibrated_reference, "" if facts.is_measured else " (upper bound)"
    errors = [(f"noise floor{bound}", document["noise_floor_rmse"])]
    if gain:
        reference = write_one("diagnosis", "reference", f=facts)
        errors = [(reference, gain["before"]["rmse"]), (_EXTENDED, gain["after"]["rmse"]), *errors]
    else:
        # A recorded column has nothing to calibrate.
        name = "calibrated" if is_calibrated else "as given"
        errors = [(name, document["calibrated_rmse"]), *errors]
    if is_calibrated:
        errors = [("before the calibration", document["as_given_rmse"]), *errors]
    columns = ("error", f"RMSE ({unit})" if unit else "RMSE", "% of the standard deviation of the output")
    rows = [
        (name, f"{error:.4g}", f"{100.0 * error / deviation:.3g}" if deviation else "")
        for name, error in errors
    ]
    return columns, rows, f"All but the noise floor are errors over {document['held_out_part']}."


def _show_code(sentence: str) -> Markup:
    return Markup(write_html(sentence))


def _list_candidates(facts: DiagnosisFacts) -> list[tuple[str, str, str]]:
    """Return the name, the gain and the share of the misfit of the best screened effects."""
    return [
        (_show_code(facts.label_effect(each)), f"{each['score']:.1f}", f"{floor(100 * each['eta'])} %")
        for each in facts.document["candidates"][:_MAX_CANDIDATES]
    ]


def _list_values(document: Document) -> list[tuple[str, ...]]:
    """Return the values of each parameter of the simulation."""
    return [
        (
            each["name"] if each["unit"] in ("", "1") else f"{each['name']} ({each['unit']})",
            *("" if each[name] is None else f"{each[name]:.4g}" for name in ("before", "alone")),
            write_value({**each, "unit": ""}),
        )
        for each in document["values"]
    ]


def _show_extension(facts: DiagnosisFacts, found: Diagnosis) -> tuple[str, str, str] | None:
    """Return the equations of the extended simulation, their values and notes; None if there are none."""
    if facts.extended is None:
        return None
    return (
        Markup(write_extended_equations(found.best, found.effects, found.record).mathml),
        write_one("diagnosis", "extended_values", f=facts),
        write_one("diagnosis", "extended_notes", f=facts),
    )


def diagnosis_report(
    origin: Origin,
    found: Diagnosis,
    tested: SelfTest | None = None,
    proposal: ResidualFormula | None = None,
    parallel_map: ParallelMap = map,
) -> bytes:
    """Write the report of a diagnosis.

    Parameters
    ----------
    origin : Origin
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
    facts = DiagnosisFacts(document)
    columns, errors, remark = _tabulate_errors(facts)
    text = TEMPLATES.get_template("diagnosis.html").render(
        origin=origin,
        sha256=document["record"]["sha256"],
        document=document,
        headline=_show_code(describe_verdict(facts)),
        lead=write_one("diagnosis", "headline", f=facts),
        causes=list(map(_show_code, describe_causes(facts))),
        details=list(map(_show_code, describe_details(facts, has_extension=False))),
        extended=_show_extension(facts, found),
        error_columns=columns,
        errors=errors,
        error_remark=remark,
        figures=figures,
        values=_list_values(document),
        candidates=_list_candidates(facts),
        record=list_record(document["record"]),
        strengths=STRENGTHS,
        limits=[] if tested is None else _limits(tested, facts.label),
        mistaken=[] if tested is None else _mistaken(tested),
    )
    return text.encode()
