"""Markdown of the reference: tables, code, and the summaries that the code's own tables have."""

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def code(value: object) -> str:
    """Return a value as inline code that may be a cell of a table."""
    text = str(value)
    return f"`{text}`" if "|" not in text else f"<code>{escape(text)}</code>"


def codes(values: Iterable[object]) -> str:
    """Return values as inline code, separated by commas."""
    return ", ".join(map(code, values))


def escape(text: str) -> str:
    """Return plain text, which may hold inline code, as the cell of a table."""
    parts = re.split(r"(`+[^`]*`+)", " ".join(text.split()))
    for place, part in enumerate(parts):
        if place % 2:
            parts[place] = code(part.strip("`")) if "|" in part else part
        else:
            plain = part.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
            parts[place] = re.sub(r"([*_|\[\]])", lambda mark: f"&#{ord(mark[1])};", plain)
    return "".join(parts)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; the cells are Markdown already."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def summarise(entry: Any) -> str:
    """Return the summary of a table's entry: an attribute that describes it, or its first docstring line."""
    for name in ("summary", "description", "source"):
        if isinstance(text := getattr(entry, name, None), str) and text:
            return text
    lines = (inspect.getdoc(entry) or "").partition("\n\n")[0]
    return " ".join(lines.split()).replace("``", "`").rstrip(".")


def entries(header: str, found: Mapping[str, Any]) -> str:
    """Return the table of the names and the summaries of a mapping."""
    return table(
        (header, "Meaning"), ((code(name), escape(summarise(entry))) for name, entry in found.items())
    )


def page(title: str, introduction: str, *sections: str) -> str:
    """Return a page from its title, its first paragraph and its sections."""
    return "\n".join((f"# {title}\n", f"{' '.join(introduction.split())}\n", *sections))


def section(title: str, *paragraphs: str, level: int = 2) -> str:
    """Return a section of a page."""
    return "\n".join((f"{'#' * level} {title}\n", *(f"{paragraph.strip()}\n" for paragraph in paragraphs)))
