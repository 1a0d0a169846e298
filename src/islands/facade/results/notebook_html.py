"""HTML of a result in a notebook: the equation of a model, sentences and a figure."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from islands.models.coupled_narx import AnyModel
from islands.report.text.layout import write_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def render_html(model: AnyModel, sentences: Iterable[str], figure: "Figure | None" = None) -> str:
    """Return the equation of a model in MathML, sentences as paragraphs, and a figure as an image."""
    return render_sentences(sentences, figure, "free run and measurement", model.equation().mathml)


def render_sentences(
    sentences: Iterable[str], figure: "Figure | None", alternative: str, heading: str = ""
) -> str:
    """Return HTML, sentences as paragraphs, and a figure as an image with an alternative text."""
    paragraphs = "".join(f"<p>{write_html(sentence)}</p>" for sentence in sentences)
    image = ""
    if figure is not None:
        from islands.report.figures.style import image_html  # noqa: PLC0415 - matplotlib takes half a second

        image = image_html(figure, alternative)
    return f"<div>{heading}{paragraphs}{image}</div>"
