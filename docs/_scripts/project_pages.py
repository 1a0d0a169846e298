"""Pages that are files of the repository's root: the README as home, contributing guide and changelog."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: Page of the site for a file of the root.
SOURCES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}

_LINK = re.compile(r"\[([^\]]+)\]\(([^)\s]+)\)")


def make_pages() -> Iterator[tuple[str, str]]:
    """Yield the path below ``docs/`` and the text of each page."""
    for page, source in SOURCES.items():
        yield page, adapt_links((ROOT / source).read_text("utf-8"))


def adapt_links(text: str) -> str:
    """Make links relative to ``docs/``; a link to another file of the repository becomes its text."""
    by_source = {source: page for page, source in SOURCES.items()}

    def adapt(match: re.Match[str]) -> str:
        label, target = match.groups()
        if "://" in target or target.startswith("#"):
            return match[0]
        path, mark, anchor = target.partition("#")
        if path in by_source:
            return f"[{label}]({by_source[path]}{mark}{anchor})"
        if path.startswith("docs/"):
            return f"[{label}]({path.removeprefix('docs/')}{mark}{anchor})"
        return label

    return _LINK.sub(adapt, text)
