"""HTML of a model in a notebook: sentences, the equation and a figure."""

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from islands.model.equations import mathml_equation
from islands.model.model import Model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Style of an image: a figure is drawn on white, also in a dark notebook.
_STYLE = "max-width: 100%; background: white"


def render_html(model: Model, sentences: Iterable[str], figure: "Figure | None" = None) -> str:
    """Return the equation of a model in MathML, sentences as paragraphs, and a figure as an image."""
    paragraphs = "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)
    image = "" if figure is None else image_html(figure, "free run and measurement")
    return f"<div>{mathml_equation(model)}{paragraphs}{image}</div>"


def image_html(figure: "Figure", alternative: str) -> str:
    """Return a figure as an image, with an alternative text.

    An image keeps the identifiers of the figure's shapes apart from those of other figures in the notebook.
    """
    from islands.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second to import

    stream = BytesIO()
    save(figure, stream)
    image = b64encode(stream.getvalue()).decode("ascii")
    return f'<img src="data:image/svg+xml;base64,{image}" alt="{escape(alternative)}" style="{_STYLE}">'
