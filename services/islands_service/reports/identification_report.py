"""The report of a job: one HTML file with everything in it, to be kept, printed or sent."""

import base64
from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from islands.evolution.search_result import SearchResult
from islands.io.result_folder import COLUMNS, row
from islands.model.equations import mathml_equation

#: Pages that are files of their own.
TEMPLATES = Environment(
    loader=PackageLoader("islands_service", "templates"),
    autoescape=select_autoescape(),
    trim_blocks=True,
    undefined=StrictUndefined,
)

#: What figures show, in the order of a report.
CAPTIONS = {
    "free-run.svg": "Free run of the best model over the validation data",
    "loop.svg": "Output over input",
    "hold.svg": "Holds: where the output stays when the input rests",
    "residuals.svg": "Correlations of the one-step-ahead residual",
    "record.svg": "The record",
    "front.svg": "Error against size",
    "convergence.svg": "Error over generations, by size",
    "islands.svg": "Error over generations, by island",
}


def identification_report(name: str, found: SearchResult, figures: Mapping[str, bytes]) -> bytes:
    """Write the report of a result.

    Parameters
    ----------
    name : str
        Of the job.
    findings : SearchResult
    figures : mapping
        SVG by name; those that `CAPTIONS` knows are shown.
    """
    models = [
        # MathML of our own making, from numbers and names of ours: the only text that is not escaped.
        {"cells": row(rank, entry), "equation": Markup(mathml_equation(entry.model))}
        for rank, entry in enumerate(found.models, start=1)
    ]
    shown = [(caption, _inline(figures[each])) for each, caption in CAPTIONS.items() if each in figures]
    text = TEMPLATES.get_template("report.html").render(
        name=name,
        record=found.record,
        findings=found,
        settings=_settings(found),
        columns=COLUMNS,
        models=models,
        figures=shown,
    )
    return text.encode()


def _settings(found: SearchResult) -> list[tuple[str, Any]]:
    return [(name, value) for name, value in found.settings.items() if not isinstance(value, Mapping)]


def _inline(svg: bytes) -> str:
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
