"""Pages that are files of the repository's root, and links between written and generated pages.

A link of a document leads to a file of the repository, so that it works where the site is not built. In the
site, a link to the source of a generated page leads to that page.
"""

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: Page of the site for a file of the root.
SOURCES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}

#: Page of the site for its source. That of ``examples/NAME.py`` is ``tutorials/NAME.md``.
GENERATED = {
    "reference/api.md": "src/islands/__init__.pyi",
    "reference/effects.md": "src/islands/effects/catalogue.py",
    "reference/primitives.md": "src/islands/expressions/primitives.py",
    "reference/rest.md": "api/islands_api/web/app.py",
    "reference/service-settings.md": "services/islands_service/settings.py",
    "reference/settings.md": "src/islands/evolution/settings.py",
    "reference/simulators.md": "src/islands/simulators/specification/table.py",
}

_PAGES = {source: page for page, source in (SOURCES | GENERATED).items()}

_LINK = re.compile(r"\[([^\]]+)\]\(([^)\s]+)\)")


def make_pages() -> Iterator[tuple[str, str]]:
    """Yield the path below ``docs/`` and the text of each page."""
    for page, source in SOURCES.items():
        yield page, adapt_links((ROOT / source).read_text("utf-8"), source)


def find_page(file: str) -> str | None:
    """Return the page of the site for a file of the repository, by its path; None if there is none."""
    if file in _PAGES:
        return _PAGES[file]
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    match = re.fullmatch(r"examples/(\w+)\.py", file)
    return f"tutorials/{match[1]}.md" if match else None


def adapt_links(text: str, source: str) -> str:
    """Let the links of a document lead to pages of the site.

    Parameters
    ----------
    text : str
    source : str
        Path of the document in the repository. A link to a file that is no page becomes its text.
    """
    folder = posixpath.dirname(find_page(source) or "")

    def adapt(match: re.Match[str]) -> str:
        label, target = match.groups()
        if re.match(r"[a-z]+:|#", target):
            return match[0]
        path, mark, anchor = target.partition("#")
        page = find_page(posixpath.normpath(posixpath.join(posixpath.dirname(source), path)))
        return f"[{label}]({posixpath.relpath(page, folder or '.')}{mark}{anchor})" if page else label

    return _LINK.sub(adapt, text)
