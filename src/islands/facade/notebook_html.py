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


def render_html(model: Model, sentences: Iterable[str], figure: "Figure") -> str:
    """Return the equation of a model in MathML, sentences as paragraphs, and a figure as an image.

    An image keeps the identifiers of the figure's shapes apart from those of other figures in the notebook.
    """
    from islands.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second to import

    stream = BytesIO()
    save(figure, stream)
    paragraphs = "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)
    image = b64encode(stream.getvalue()).decode("ascii")
    return (
        f"<div>{mathml_equation(model)}{paragraphs}"
        f'<img src="data:image/svg+xml;base64,{image}" alt="free run and measurement"></div>'
    )
