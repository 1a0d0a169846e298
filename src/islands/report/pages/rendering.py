"""HTML templates of reports, figures inside of pages, and the entries of the record."""

import base64
from io import BytesIO
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from islands.report.text.facts import Document

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Environment of the HTML templates.
TEMPLATES = Environment(
    loader=PackageLoader("islands.report.pages", "templates"),
    autoescape=select_autoescape(),
    trim_blocks=True,
    undefined=StrictUndefined,
)


def inline_figure(figure: "Figure") -> str:
    """Return a figure as the address of an embedded image."""
    from islands.report.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second

    stream = BytesIO()
    save(figure, stream)
    return inline_svg(stream.getvalue())


def inline_svg(svg: bytes) -> str:
    """Return an SVG as the address of an embedded image."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def list_record(record: Document) -> list[tuple[str, Any]]:
    """Return the samples, sampling time, columns and hash of a record, as ``result.json`` describes it."""
    names = record["names"]
    outputs = names.get("outputs", [names.get("output")])
    return [
        ("samples", record["samples"]),
        ("sampling time", f"{record['dt']:g} s"),
        ("inputs", ", ".join(names["inputs"])),
        ("output" if len(outputs) == 1 else "outputs", ", ".join(outputs)),
        ("SHA-256", record["sha256"]),
    ]
