"""Page of a reproduction: one HTML file for both themes, its figures as SVG, and the numbers as JSON."""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from io import BytesIO
from pathlib import Path

from islands.persistence.checkpoints import replace_file
from islands.report.figures.style import THEMES, save
from lab.reproduction.section import ComparisonTable, Section, SectionFigure

#: Files of a reproduction in its folder.
PAGE, NUMBERS, FIGURES = "reproduction.html", "reproduction.json", "figures"

_TITLE = "The paper reproduced"

_STYLE = """
:root { color-scheme: light dark; --ink: #222; --soft: #556; --line: #d5d9de; --paper: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #dcdfe4; --soft: #9dabb3; --line: #3a464e; --paper: #16181d; }
}
body {
  font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
}
h1 { font-size: 1.5rem; } h2 { font-size: 1.25rem; margin-top: 3rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 2rem 0 .5rem; }
p { max-width: 52rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .85rem; }
th, td { padding: .25rem .6rem; text-align: right; vertical-align: top; }
th, td { border-bottom: 1px solid var(--line); }
th { font-weight: 600; }
th:first-child, td:first-child, th:last-child, td:last-child { text-align: left; }
td:last-child { color: var(--soft); min-width: 18rem; }
td:not(:first-child, :last-child) { white-space: nowrap; }
figure { margin: 1.5rem 0; break-inside: avoid; } img { max-width: 100%; }
figcaption { color: var(--soft); font-size: .9rem; }
"""


def write_reproduction(sections: Sequence[Section], folder: Path) -> tuple[Path, ...]:
    """Write the page, the figures of both themes and the numbers; equal sections give equal bytes.

    Parameters
    ----------
    sections : sequence of Section
    folder : Path
        Folder; it is created.

    Returns
    -------
    tuple of Path
        The page, the numbers and the folder of the figures.
    """
    figures = folder / FIGURES
    figures.mkdir(parents=True, exist_ok=True)
    drawn = {figure.name: _draw(figure) for section in sections for figure in section.figures}
    for name, images in drawn.items():
        for theme, image in images.items():
            suffix = "" if theme == "light" else f"-{theme}"
            replace_file([image], figures / f"{name}{suffix}.svg")
    parts = "\n".join(_render_section(section, drawn) for section in sections)
    page = (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{_TITLE}</title>\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{_TITLE}</h1>\n{parts}\n</body>\n</html>\n"
    )
    replace_file([page.encode()], folder / PAGE)
    document = {section.title: _to_document(section) for section in sections}
    replace_file([(json.dumps(document, indent=1, allow_nan=False) + "\n").encode()], folder / NUMBERS)
    return folder / PAGE, folder / NUMBERS, figures


def _draw(figure: SectionFigure) -> dict[str, bytes]:
    """Return a figure as SVG in every theme."""
    images = {}
    for theme in THEMES:
        stream = BytesIO()
        save(figure.draw(theme), stream)
        images[theme] = stream.getvalue()
    return images


def _render_section(section: Section, drawn: Mapping[str, Mapping[str, bytes]]) -> str:
    paragraphs = "\n".join(f"<p>{escape(text)}</p>" for text in section.introduction)
    tables = "\n".join(map(_render_table, section.tables))
    figures = "\n".join(_render_figure(figure, drawn[figure.name]) for figure in section.figures)
    return f"<section>\n<h2>{escape(section.title)}</h2>\n{paragraphs}\n{tables}\n{figures}\n</section>"


def _render_table(table: ComparisonTable) -> str:
    head = "".join(f'<th scope="col">{escape(column)}</th>' for column in table.columns)
    rows = "\n".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows)
    return (
        f'<h3>{escape(table.title)}</h3>\n<div class="wide"><table>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{rows}\n</tbody>\n</table></div>"
    )


def _render_figure(figure: SectionFigure, images: Mapping[str, bytes]) -> str:
    """Return both themes of a figure in an element that shows that of the reader's system."""
    light, dark = (
        f"data:image/svg+xml;base64,{b64encode(images[theme]).decode()}" for theme in ("light", "dark")
    )
    caption = escape(figure.caption)
    return (
        f'<figure><picture><source srcset="{dark}" media="(prefers-color-scheme: dark)">'
        f'<img src="{light}" alt="{caption}"></picture><figcaption>{caption}</figcaption></figure>'
    )


def _to_document(section: Section) -> dict[str, object]:
    return {
        "introduction": list(section.introduction),
        "tables": [
            {"title": table.title, "columns": list(table.columns), "rows": [list(row) for row in table.rows]}
            for table in section.tables
        ],
        "figures": {figure.name: figure.caption for figure in section.figures},
        "numbers": section.document,
    }
