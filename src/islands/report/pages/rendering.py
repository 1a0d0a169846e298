"""HTML templates of reports, and figures inside of pages."""

import base64
from io import BytesIO
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

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
